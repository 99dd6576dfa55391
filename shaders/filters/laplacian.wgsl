// The differences to the four neighbours, added up.

fn at(xy: vec2i) -> vec4f {
    let here = load_image(xy).rgb;
    let across = (load_image(xy - vec2i(1, 0)).rgb - here) + (load_image(xy + vec2i(1, 0)).rgb - here);
    let down = (load_image(xy - vec2i(0, 1)).rgb - here) + (load_image(xy + vec2i(0, 1)).rgb - here);
    return vec4f(across + down, 1.0);
}
