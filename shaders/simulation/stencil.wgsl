// The 5-point Laplacian and the damping that the wave shaders share; `state` is read with the border policy of the
// boundary, so ghost pixels need no branch.

/// c²∇² of the first three components. Differences first: neighbours are alike, so they lose nothing.
fn curvature(xy: vec2i) -> vec3f {
    let here = load_state(xy).xyz;
    let across = (load_state(xy - vec2i(1, 0)).xyz - here) + (load_state(xy + vec2i(1, 0)).xyz - here);
    let down = (load_state(xy - vec2i(0, 1)).xyz - here) + (load_state(xy + vec2i(0, 1)).xyz - here);
    return params.stiffness * (across + down);
}

/// γ: an absorbing edge adds to it for each open side of the pixel.
fn resistance(xy: vec2i) -> f32 {
    if !ABSORBING {
        return params.damping;
    }
    let sides = select(vec2f(0.0), vec2f(1.0), xy == vec2i(0)) + select(vec2f(0.0), vec2f(1.0), xy == size_state() - 1);
    return params.damping + params.opening * (sides.x + sides.y);
}
