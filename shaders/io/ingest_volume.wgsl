// Voxels as they lie in a file, x fastest → a volume.
//
// Constants: CHANNELS (1..4), BYTES of a number, SIGNED, FLOATING, SCALED (apply params.scale and params.offset).

import package::lib::half::half_to_float;

fn number(index: i32) -> f32 {
    let at = index * BYTES;
    let word = load_words(at >> 2u);
    if BYTES == 4 {
        if FLOATING {
            return bitcast<f32>(word);
        }
        return select(f32(word), f32(bitcast<i32>(word)), SIGNED);
    }
    let bits = extractBits(word, u32(at & 3) * 8u, u32(BYTES) * 8u);
    if FLOATING {
        return half_to_float(bits);
    }
    let high = 32u - u32(BYTES) * 8u;
    return select(f32(bits), f32(bitcast<i32>(bits << high) >> high), SIGNED);
}

fn stored(index: i32) -> f32 {
    if SCALED {
        return number(index) * params.scale + params.offset;
    }
    return number(index);
}

fn decode(xyz: vec3i) -> vec4f {
    let size = size_out();
    let index = ((xyz.z * size.y + xyz.y) * size.x + xyz.x) * CHANNELS;
    var v = vec4f(vec3f(stored(index)), 1.0);
    if CHANNELS == 2 {
        return vec4f(v.x, stored(index + 1), 0.0, 1.0);
    }
    if CHANNELS >= 3 {
        v = vec4f(v.x, stored(index + 1), stored(index + 2), 1.0);
    }
    if CHANNELS == 4 {
        v.w = stored(index + 3);
    }
    return v;
}
