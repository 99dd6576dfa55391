fn at(xy: vec2i) -> vec4f {
    let pixel = 2 * (xy.y * size_out().x + xy.x);
    return vec4f(vec3f(load_pixels(pixel)), load_pixels(pixel + 1));
}
