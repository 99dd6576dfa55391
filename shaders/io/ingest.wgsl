// Pixels as they lie in a file → linear Rec.709, associated alpha.
//
// Constants: CHANNELS (1..4), BYTES of a sample, FLOATING, TRANSFER (0 linear, 1 sRGB, 2 gamma), STRAIGHT,
// HAS_ALPHA, CONVERT (apply the matrix), PLANAR. The function `word(c, i)`, added behind this file, reads
// the i-th 32-bit word of plane c (of plane 0 when interleaved).

import package::lib::half::half_to_float;
import package::lib::transfer::{srgb_to_linear, gamma_transfer};

fn stored(c: i32, pixel: i32) -> f32 {
    let index = select(pixel * CHANNELS + c, pixel, PLANAR);
    let plane = select(0, c, PLANAR);
    if BYTES == 1 {
        let bits = word(plane, index >> 2u);
        return f32((bits >> (u32(index & 3) * 8u)) & 0xffu) / 255.0;
    }
    if BYTES == 2 {
        let bits = (word(plane, index >> 1u) >> (u32(index & 1) * 16u)) & 0xffffu;
        if FLOATING {
            return half_to_float(bits);
        }
        return f32(bits) / 65535.0;
    }
    return bitcast<f32>(word(plane, index));
}

fn decode(x: i32, row: i32) -> vec4f {
    let place = vec2i(x, row) - first_c0();
    let p = place.y * held_c0().x + place.x;
    var rgb = vec3f(stored(0, p));
    if CHANNELS >= 3 {
        rgb = vec3f(rgb.x, stored(1, p), stored(2, p));
    }
    if CHANNELS == 2 && !HAS_ALPHA {
        return vec4f(rgb.x, stored(1, p), 0.0, 1.0);
    }
    var alpha = 1.0;
    if HAS_ALPHA {
        alpha = stored(CHANNELS - 1, p);
    }
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
