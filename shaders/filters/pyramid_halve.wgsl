// (1 4 6 4 1)/16 along one axis, at every other sample. Sample 0 stands at sample `shift` of the finer level.

fn at(xy: vec2i) -> vec4f {
    let along = select(vec2i(0, 1), vec2i(1, 0), ALONG_X);
    let centre = xy + along * (select(xy.y, xy.x, ALONG_X) + params.shift);
    let near = load_image(centre - along) + load_image(centre + along);
    let far = load_image(centre - 2 * along) + load_image(centre + 2 * along);
    return 0.375 * load_image(centre) + 0.25 * near + 0.0625 * far;
}
