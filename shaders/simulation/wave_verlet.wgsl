// Velocity Verlet with the end of each step and the start of the next in one pass (leapfrog). Between passes the state
// is (u, w), w the velocity half a step ahead: w = v + h/2·(c²∇²u − γv).
// STAGE 0: v to w; 1: a whole step; 2: the last step, which ends with v.

fn at(xy: vec2i) -> vec4f {
    let state = load_state(xy);
    let l = curvature(xy);
    let g = resistance(xy);
    let h = params.dt;
    if STAGE == 0 {
        return vec4f(state.x, state.y + 0.5 * h * (l.x - g * state.y), 0.0, 1.0);
    }
    let u = state.x + h * state.y;
    let pull = l.x + h * l.y;
    // v′ = w + h/2·(pull − γv′)
    let v = (state.y + 0.5 * h * pull) / (1.0 + 0.5 * h * g);
    if STAGE == 1 {
        return vec4f(u, v + 0.5 * h * (pull - g * v), 0.0, 1.0);
    }
    return vec4f(u, v, 0.0, 1.0);
}
