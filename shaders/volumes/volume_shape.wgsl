// SOLID: 0 sphere, 1 torus, 2 box.

fn distance_to(p: vec3f) -> f32 {
    if SOLID == 0 {
        return length(p) - params.size;
    }
    if SOLID == 1 {
        return length(vec2f(length(p.xy) - params.size, p.z)) - params.size / 3.0;
    }
    let q = abs(p) - params.size;
    return length(max(q, vec3f(0.0))) + min(max(q.x, max(q.y, q.z)), 0.0);
}

fn at(xyz: vec3i) -> vec4f {
    let p = (vec3f(xyz) + 0.5) / vec3f(size_out()) - 0.5;
    return vec4f(clamp(0.5 - distance_to(p) / params.softness, 0.0, 1.0));
}
