// The right side of A·v′ = r for an implicit step, and the guess v′ ≈ v (twice: this and the one before).
// θ = 1: backward Euler; θ = ½: Crank-Nicolson.

fn each(xy: vec2i) {
    let v = load_state(xy).y;
    let l = curvature(xy);
    let g = resistance(xy);
    let h = params.dt;
    let t = params.theta;
    store_rhs(xy, vec4f(v * (1.0 - (1.0 - t) * g * h) + h * l.x + t * (1.0 - t) * h * h * l.y));
    store_guess(xy, vec4f(v, v, 0.0, 1.0));
}
