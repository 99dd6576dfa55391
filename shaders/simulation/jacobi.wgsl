fn at(xy: vec2i) -> vec4f {
    let across = load_image(xy - vec2i(1, 0)) + load_image(xy + vec2i(1, 0));
    let down = load_image(xy - vec2i(0, 1)) + load_image(xy + vec2i(0, 1));
    return vec4f(0.25 * (across + down - load_rhs(xy)).rgb, load_image(xy).a);
}
