/// So little that thousands of samples of it are nothing.
const TRANSPARENT: f32 = 1e-7;

fn opacity(d: f32) -> f32 {
    return clamp(params.alpha_exponent * (d - params.alpha_center) + 0.5, 0.0, 1.0);
}

fn emptiness(p: vec3f, direction: vec3f) -> f32 {
    let here = brick(p, direction);
    return select(0.0, here.length, opacity(here.extreme) <= TRANSPARENT);
}

fn transfer(p: vec3f) -> vec4f {
    let d = density(p);
    let alpha = opacity(d);
    if alpha <= TRANSPARENT {
        return vec4f();
    }
    return vec4f(lit(p, normal_at(p)) * vec3f(d, d * d, d * d * d) + 0.1, alpha);
}
