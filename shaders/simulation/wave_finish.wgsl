// u′ = u + h·(θv′ + (1 − θ)v)

fn apply(state: vec4f, solution: vec4f) -> vec4f {
    let mean = params.theta * solution.x + (1.0 - params.theta) * state.y;
    return vec4f(state.x + params.dt * mean, solution.x, 0.0, 1.0);
}
