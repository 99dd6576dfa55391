// VARIETY: 0 White, 1 Value, 2 Perlin, 3 Simplex, 4 Worley.

import package::lib::random::{lattice_hash, hash_unit};

fn gradient(cell: vec2i, seed: u32, d: vec2f) -> f32 {
    let angle = 6.283185307179586 * hash_unit(lattice_hash(cell, seed));
    return cos(angle) * d.x + sin(angle) * d.y;
}

fn fade(t: vec2f) -> vec2f {
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}

fn simplex_corner(cell: vec2i, seed: u32, d: vec2f) -> f32 {
    let m = max(0.5 - dot(d, d), 0.0);
    return m * m * m * m * gradient(cell, seed, d);
}

fn noise(at: vec2f, seed: u32) -> f32 {
    let whole = floor(at);
    let f = at - whole;
    let c = vec2i(whole);
    if VARIETY == 0 {
        return hash_unit(lattice_hash(c, seed));
    }
    if VARIETY == 1 {
        let t = fade(f);
        let top = mix(hash_unit(lattice_hash(c, seed)), hash_unit(lattice_hash(c + vec2i(1, 0), seed)), t.x);
        let low = mix(hash_unit(lattice_hash(c + vec2i(0, 1), seed)), hash_unit(lattice_hash(c + vec2i(1, 1), seed)), t.x);
        return mix(top, low, t.y);
    }
    if VARIETY == 2 {
        let t = fade(f);
        let top = mix(gradient(c, seed, f), gradient(c + vec2i(1, 0), seed, f - vec2f(1.0, 0.0)), t.x);
        let low = mix(gradient(c + vec2i(0, 1), seed, f - vec2f(0.0, 1.0)), gradient(c + vec2i(1, 1), seed, f - 1.0), t.x);
        return 0.5 + mix(top, low, t.y) * 0.7071067811865476;
    }
    if VARIETY == 3 {
        let skewed = floor(at + (at.x + at.y) * 0.3660254037844386);
        let cell = vec2i(skewed);
        let d0 = at - (skewed - (skewed.x + skewed.y) * 0.21132486540518713);
        let middle = select(vec2i(0, 1), vec2i(1, 0), d0.x > d0.y);
        let d1 = d0 - vec2f(middle) + 0.21132486540518713;
        let d2 = d0 - 1.0 + 2.0 * 0.21132486540518713;
        let sum = simplex_corner(cell, seed, d0) + simplex_corner(cell + middle, seed, d1) + simplex_corner(cell + 1, seed, d2);
        return clamp(0.5 + 35.0 * sum, 0.0, 1.0);
    }
    var least = 1e9;
    for (var j = -1; j <= 1; j++) {
        for (var i = -1; i <= 1; i++) {
            let cell = c + vec2i(i, j);
            let p = vec2f(hash_unit(lattice_hash(cell, seed)), hash_unit(lattice_hash(cell, seed ^ 0x9E3779B9u)));
            let d = vec2f(f32(i), f32(j)) + p - f;
            least = min(least, dot(d, d));
        }
    }
    return min(sqrt(least), 1.0);
}

fn apply() -> vec4f {
    let centre = select(vec2f(0.5), vec2f(0.0), VARIETY == 0);
    let at = (vec2f(pixel()) + centre) * params.scale;
    var sum = 0.0;
    var weights = 0.0;
    var weight = 1.0;
    var f = 1.0;
    for (var octave = 0; octave < OCTAVES; octave++) {
        sum += weight * noise(at * f, params.seed + u32(octave));
        weights += weight;
        weight *= 0.5;
        f *= 2.0;
    }
    return vec4f(sum / weights);
}
