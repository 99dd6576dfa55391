fn transfer(p: vec3f) -> vec4f {
    let d = density(p);
    let alpha = clamp(params.alpha_exponent * (d - params.alpha_center) + 0.5, 0.0, 1.0);
    if alpha == 0.0 {
        return vec4f();
    }
    let lit = 0.5 + 0.5 * dot(facing(gradient(p)), normalize(params.light - p));
    return vec4f(lit * vec3f(d, d * d, d * d * d) + 0.1, alpha);
}
