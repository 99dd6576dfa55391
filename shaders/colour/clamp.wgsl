// max(low, min(high, c))

import package::lib::number::is_nan;

fn bound(v: f32) -> f32 {
    return select(max(params.low, min(params.high, v)), v, is_nan(v));
}

fn apply(image: vec4f) -> vec4f {
    return vec4f(bound(image.r), bound(image.g), bound(image.b), image.a);
}
