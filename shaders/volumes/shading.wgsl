// Surfaces of the port `volume` lit by a point light, in a volume that is seen with the camera's proportions.

/// The direction that the surface through a point faces, as it is seen.
fn normal_at(p: vec3f) -> vec3f {
    return facing(gradient(p) / params.proportions);
}

/// 0.5 + 0.5·n·l
fn lit(p: vec3f, n: vec3f) -> f32 {
    let l = params.light - seen_at(p, params.proportions);
    return 0.5 + 0.5 * dot(n, l) / max(length(l), 1e-20);
}
