// Random numbers from integers: the same on every device.

import package::lib::wide::wide_product;

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

/// Four words from a counter and a key: `philox4x32-7` of J. Salmon et al., Parallel Random Numbers: As Easy as 1, 2, 3,
/// 2011; seven rounds are the fewest that pass BigCrush.
fn philox(counter: vec4u, key: vec2u) -> vec4u {
    var c = counter;
    var k = key;
    for (var round = 0; round < 7; round++) {
        let p = wide_product(0xd2511f53u, c.x);
        let q = wide_product(0xcd9e8d57u, c.z);
        c = vec4u(q.y ^ c.y ^ k.x, q.x, p.y ^ c.w ^ k.y, p.x);
        k += vec2u(0x9e3779b9u, 0xbb67ae85u);
    }
    return c;
}

/// The next state of the hybrid Tausworthe generator of L. Howes and D. Thomas, Efficient Random Number Generation and
/// Application Using CUDA, GPU Gems 3, 2007: three Tausworthe registers, each above 128, and a linear congruence. The
/// random word is the exclusive or of all four.
fn tausworthe(state: vec4u) -> vec4u {
    let z = state.xyz;
    let b = ((z << vec3u(13u, 2u, 3u)) ^ z) >> vec3u(19u, 25u, 11u);
    let next = ((z & vec3u(0xfffffffeu, 0xfffffff8u, 0xfffffff0u)) << vec3u(12u, 4u, 17u)) ^ b;
    return vec4u(next, 1664525u * state.w + 1013904223u);
}

/// A word as a number in 0..1, both excluded: its upper 23 bits.
fn open_unit(h: u32) -> f32 {
    return (f32(h >> 9u) + 0.5) / 8388608.0;
}

/// A word as an exponentially distributed number of mean 1: −ln of it as a number in 0..1 with 24 significant bits. Not by
/// `log`, which drivers compute to few digits.
fn exponential(h: u32) -> f32 {
    let zeros = countLeadingZeros(h | 1u);
    var doublings = f32(zeros);
    var y = f32(((h | 1u) << zeros) >> 8u) / 16777216.0;
    if y < 0.70710678 {
        y *= 2.0;
        doublings += 1.0;
    }
    // ln y = 2 artanh s, s = (y − 1)/(y + 1)
    let s = (y - 1.0) / (y + 1.0);
    let q = s * s;
    return doublings * 0.693147181 - 2.0 * s * (1.0 + q * (0.333333333 + q * (0.2 + q * (0.142857143 + q * 0.111111111))));
}
