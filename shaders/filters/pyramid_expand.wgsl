// The cubic B-spline of the coarse samples along one axis. Pixel 0 stands at coarse sample `shift`.

fn at(xy: vec2i) -> vec4f {
    let along = select(vec2i(0, 1), vec2i(1, 0), ALONG_X);
    let i = select(xy.y, xy.x, ALONG_X);
    let base = xy + along * ((i >> HALVINGS) + params.shift - i);
    let f = f32(i & ((1 << HALVINGS) - 1)) / f32(1 << HALVINGS);
    let g = 1.0 - f;
    let outer = g * g * g * load_image(base - along) + f * f * f * load_image(base + 2 * along);
    let inner = (4.0 - 6.0 * f * f + 3.0 * f * f * f) * load_image(base) + (4.0 - 6.0 * g * g + 3.0 * g * g * g) * load_image(base + along);
    return (inner + outer) / 6.0;
}
