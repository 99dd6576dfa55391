// T + α·dt·∇²T

fn at(xy: vec2i) -> vec4f {
    let here = load_image(xy);
    let across = (load_image(xy - vec2i(1, 0)) - here) + (load_image(xy + vec2i(1, 0)) - here);
    let down = (load_image(xy - vec2i(0, 1)) - here) + (load_image(xy + vec2i(0, 1)) - here);
    return here + params.rate * (across + down);
}
