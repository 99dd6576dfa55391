// DECODE, ENCODE: 0 linear, 1 sRGB, 2 ITU-R BT.709.

import package::lib::color::keep_nan;
import package::lib::transfer::{srgb_to_linear, linear_to_srgb};

fn bt709_to_linear(v: vec3f) -> vec3f {
    let a = abs(v);
    return sign(v) * select(pow((a + 0.099) / 1.099, vec3f(1.0 / 0.45)), a / 4.5, a < vec3f(0.081));
}

fn linear_to_bt709(v: vec3f) -> vec3f {
    let a = abs(v);
    return sign(v) * select(1.099 * pow(a, vec3f(0.45)) - 0.099, a * 4.5, a < vec3f(0.018));
}

fn apply(image: vec4f) -> vec4f {
    var c = image.rgb;
    if DECODE == 1 {
        c = keep_nan(srgb_to_linear(c), c);
    } else if DECODE == 2 {
        c = keep_nan(bt709_to_linear(c), c);
    }
    if MIXES {
        c = vec3f(dot(params.row0, c), dot(params.row1, c), dot(params.row2, c));
    }
    if ENCODE == 1 {
        c = keep_nan(linear_to_srgb(c), c);
    } else if ENCODE == 2 {
        c = keep_nan(linear_to_bt709(c), c);
    }
    return vec4f(c, image.a);
}
