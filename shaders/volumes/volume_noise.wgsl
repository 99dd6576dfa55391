import package::lib::random::lattice_hash_3d;

// One of the twelve edges of a cube: the axis that it is parallel to has no part in it.
fn gradient(cell: vec3i, seed: u32, d: vec3f) -> f32 {
    let h = lattice_hash_3d(cell, seed) >> 8u;
    var ab = d.xy;
    switch h % 3u {
        case 0u: { ab = d.yz; }
        case 1u: { ab = d.zx; }
        default: {}
    }
    return select(ab.x, -ab.x, h / 3u % 2u == 1u) + select(ab.y, -ab.y, h / 6u % 2u == 1u);
}

fn edge(cell: vec3i, seed: u32, f: vec3f, t: f32) -> f32 {
    return mix(gradient(cell, seed, f), gradient(cell + vec3i(1, 0, 0), seed, f - vec3f(1.0, 0.0, 0.0)), t);
}

fn face(cell: vec3i, seed: u32, f: vec3f, t: vec2f) -> f32 {
    return mix(edge(cell, seed, f, t.x), edge(cell + vec3i(0, 1, 0), seed, f - vec3f(0.0, 1.0, 0.0), t.x), t.y);
}

fn noise(p: vec3f, seed: u32) -> f32 {
    let whole = floor(p);
    let f = p - whole;
    let t = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let cell = vec3i(whole);
    let near = face(cell, seed, f, t.xy);
    let far = face(cell + vec3i(0, 0, 1), seed, f - vec3f(0.0, 0.0, 1.0), t.xy);
    return 0.5 + 0.5 * mix(near, far, t.z);
}

fn at(xyz: vec3i) -> vec4f {
    let p = (vec3f(xyz) + 0.5) / vec3f(size_out()) * params.frequency;
    var sum = 0.0;
    var weights = 0.0;
    var weight = 1.0;
    var f = 1.0;
    for (var octave = 0; octave < OCTAVES; octave++) {
        sum += weight * noise(p * f, params.seed + u32(octave));
        weights += weight;
        weight *= 0.5;
        f *= 2.0;
    }
    return vec4f(clamp(sum / weights, 0.0, 1.0));
}
