// Luminance of linear Rec.709 light, and colours with NaN in them.

/// Y = 0.2126 R + 0.7152 G + 0.0722 B (ITU-R BT.709-6).
fn luminance(c: vec3f) -> f32 {
    return 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
}

/// `v`, but NaN where `c` is NaN: for what has gone through min, max, clamp or pow, where WGSL promises nothing.
fn keep_nan(v: vec3f, c: vec3f) -> vec3f {
    return select(v, c, (bitcast<vec3u>(c) & vec3u(0x7fffffffu)) > vec3u(0x7f800000u));
}
