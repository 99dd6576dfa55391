// Linear Rec.709, associated alpha → pixels as they will lie in a file.
//
// One call packs the pixels of whole words: 4 of 8 bits, 2 of 16 bits, 1 of 32 bits. Constants as in ingest.wgsl,
// and FIRST_ROW, where the band begins; GREY takes the luminance of a colour image. The function
// `put(c, i, bits)`, added behind this file, stores the i-th word of plane c.

import package::lib::color::luminance;
import package::lib::half::float_to_half;
import package::lib::number::is_nan;
import package::lib::transfer::{linear_to_srgb, gamma_transfer};

fn encode(pixel: i32) -> vec4f {
    let columns = held_c0().x;
    let v = load_image(first_c0() + vec2i(pixel % columns, FIRST_ROW + pixel / columns));
    var rgb = v.rgb;
    if STRAIGHT && v.a != 0.0 {
        rgb /= v.a;
    }
    if CONVERT {
        rgb = vec3f(dot(params.row0, rgb), dot(params.row1, rgb), dot(params.row2, rgb));
    }
    if GREY {
        rgb = vec3f(luminance(rgb));
    }
    if TRANSFER == 1 {
        rgb = linear_to_srgb(rgb);
    } else if TRANSFER == 2 {
        rgb = gamma_transfer(rgb, params.gamma);
    }
    return vec4f(rgb, v.a);
}

fn bits(v: f32) -> u32 {
    if BYTES == 4 {
        return bitcast<u32>(v);
    }
    if FLOATING {
        return float_to_half(v);
    }
    let code = u32(clamp(v, 0.0, 1.0) * select(65535.0, 255.0, BYTES == 1) + 0.5);
    return select(code, 0u, is_nan(v));
}

/// The sample of channel c: the last one is alpha when there is one.
fn component(v: vec4f, c: i32) -> f32 {
    if HAS_ALPHA && c == CHANNELS - 1 {
        return v.a;
    }
    return v[c];
}

fn each(group: i32) {
    let pixels = 4 / BYTES;
    let count = held_c0().x * held_c0().y;
    // Known when compiling unless the picture is cut into tiles.
    let whole = count % pixels == 0;
    if PLANAR {
        var words = array<u32, 4>();
        for (var k = 0; k < pixels; k++) {
            let pixel = group * pixels + k;
            if whole || pixel < count {
                let v = encode(pixel);
                for (var c = 0; c < CHANNELS; c++) {
                    words[c] |= bits(component(v, c)) << u32(k * BYTES * 8);
                }
            }
        }
        for (var c = 0; c < CHANNELS; c++) {
            put(c, group, words[c]);
        }
    } else {
        var word = 0u;
        for (var k = 0; k < pixels; k++) {
            let pixel = group * pixels + k;
            var v = vec4f();
            if whole || pixel < count {
                v = encode(pixel);
            }
            for (var c = 0; c < CHANNELS; c++) {
                let sample = k * CHANNELS + c;
                word |= bits(component(v, c)) << u32((sample * BYTES * 8) & 31);
                if (sample + 1) % pixels == 0 {
                    put(0, (group * pixels * CHANNELS + sample) / pixels, word);
                    word = 0u;
                }
            }
        }
    }
}
