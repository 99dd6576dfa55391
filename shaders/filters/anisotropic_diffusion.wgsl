// I + dt·Σ c(∇I)·∇I

fn at(xy: vec2i) -> vec4f {
    let here = load_image(xy);
    let across = flow(load_image(xy - vec2i(1, 0)) - here) + flow(load_image(xy + vec2i(1, 0)) - here);
    let down = flow(load_image(xy - vec2i(0, 1)) - here) + flow(load_image(xy + vec2i(0, 1)) - here);
    return here + params.dt * (across + down);
}

/// s/(1 + (s/κ)²)
fn flow(s: vec4f) -> vec4f {
    let t = s / params.kappa;
    return s / (1.0 + t * t);
}
