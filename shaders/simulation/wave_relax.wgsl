// One iteration of the second-order Richardson method for A = 1 + θγh − θ²h²c²∇²; the state is (x, x before).

fn at(xy: vec2i) -> vec4f {
    let x = load_state(xy).x;
    let before = load_state(xy).y;
    let th = params.theta * params.dt;
    let product = x * (1.0 + th * resistance(xy)) - th * th * curvature(xy).x;
    return vec4f(x + params.gain * (load_rhs(xy).x - product) + params.inertia * (x - before), x, 0.0, 1.0);
}
