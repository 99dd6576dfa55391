// Pixels as they lie in a file → linear Rec.709, associated alpha.
//
// Constants: CHANNELS (1..4), BYTES of a sample, FLOATING, TRANSFER (0 linear, 1 sRGB, 2 gamma), STRAIGHT,
// HAS_ALPHA, CONVERT (apply the matrix), PLANAR. The function `word(c, i)`, added behind this file, reads
// the i-th 32-bit word of plane c (of plane 0 when interleaved).

import package::lib::half::half_to_float;
import package::lib::transfer::{srgb_to_linear, gamma_transfer};

/// Samples of a word.
const PER_WORD: u32 = u32(4 / BYTES);
/// The last channel.
const LAST: u32 = u32(CHANNELS - 1);
/// Whether a pixel of interleaved samples may lie in two words.
const SPLIT: bool = CHANNELS * BYTES > 4 || CHANNELS == 3;

/// The value of sample `index` of two words.
fn sample(low: u32, high: u32, index: u32) -> f32 {
    let bits = select(low, high, index >= PER_WORD) >> ((index % PER_WORD) * u32(BYTES * 8));
    if BYTES == 1 {
        return f32(bits & 0xffu) / 255.0;
    }
    if BYTES == 2 && FLOATING {
        return half_to_float(bits & 0xffffu);
    }
    if BYTES == 2 {
        return f32(bits & 0xffffu) / 65535.0;
    }
    return bitcast<f32>(bits);
}

/// Sample `index` of plane c.
fn single(c: u32, index: u32) -> f32 {
    let bits = word(i32(c), i32(index / PER_WORD));
    return sample(bits, bits, index % PER_WORD);
}

/// The samples of a pixel, the last one in place of those that there are not. What is not used is not loaded either.
fn stored(pixel: u32) -> vec4f {
    if PLANAR {
        return vec4f(single(0u, pixel), single(min(1u, LAST), pixel), single(min(2u, LAST), pixel), single(LAST, pixel));
    }
    let index = pixel * u32(CHANNELS);
    if BYTES == 4 {
        return vec4f(single(0u, index), single(0u, index + min(1u, LAST)), single(0u, index + min(2u, LAST)), single(0u, index + LAST));
    }
    // At most two words, each loaded once.
    let low = word(0, i32(index / PER_WORD));
    var high = low;
    if SPLIT {
        high = word(0, i32(index / PER_WORD + 1u));
    }
    let first = index % PER_WORD;
    return vec4f(
        sample(low, high, first),
        sample(low, high, first + min(1u, LAST)),
        sample(low, high, first + min(2u, LAST)),
        sample(low, high, first + LAST),
    );
}

fn decode(x: i32, row: i32) -> vec4f {
    let place = vec2i(x, row) - first_c0();
    let p = place.y * held_c0().x + place.x;
    let v = stored(u32(p));
    if CHANNELS == 2 && !HAS_ALPHA {
        return vec4f(v.xy, 0.0, 1.0);
    }
    var rgb = select(v.xxx, v.xyz, CHANNELS >= 3);
    let alpha = select(1.0, v.w, HAS_ALPHA);
    if TRANSFER == 1 {
        rgb = srgb_to_linear(rgb);
    } else if TRANSFER == 2 {
        rgb = gamma_transfer(rgb, params.gamma);
    }
    if STRAIGHT {
        rgb *= alpha;
    }
    if CONVERT {
        rgb = vec3f(dot(params.row0, rgb), dot(params.row1, rgb), dot(params.row2, rgb));
    }
    return vec4f(rgb, alpha);
}
