// 1 above the threshold, else 0; NaN passes through.

import package::lib::number::is_nan;

fn side(v: f32) -> f32 {
    if is_nan(v) {
        return v;
    }
    return select(0.0, 1.0, v > params.value);
}

fn apply(image: vec4f) -> vec4f {
    return vec4f(side(image.r), side(image.g), side(image.b), image.a);
}
