// The luminance; NaN where it is not finite, so that it counts nowhere.

import package::lib::number::is_finite;
import package::lib::wide::exact_luminance;

fn apply(image: vec4f) -> vec4f {
    let y = exact_luminance(image.rgb);
    if is_finite(y) {
        return vec4f(y);
    }
    return vec4f(bitcast<f32>(bitcast<u32>(y) | 0x7fc00000u));
}
