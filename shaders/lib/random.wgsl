// Random numbers from integer hashes: the same on every device.

/// `pcg3d` of M. Jarzynski and M. Olano, Hash Functions for GPU Rendering, 2020: its first word.
fn lattice_hash(cell: vec2i, seed: u32) -> u32 {
    var v = vec3u(bitcast<vec2u>(cell), seed) * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3u(16u);
    return v.x + v.y * v.z;
}

/// A hash as a number in 0..1, 1 excluded: its upper 24 bits.
fn hash_unit(h: u32) -> f32 {
    return f32(h >> 8u) / 16777216.0;
}

/// `pcg4d` of the same authors: its first word.
fn lattice_hash_3d(cell: vec3i, seed: u32) -> u32 {
    var v = vec4u(bitcast<vec3u>(cell), seed) * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4u(16u);
    return v.x + v.y * v.w;
}
