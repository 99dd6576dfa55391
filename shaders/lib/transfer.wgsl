// Transfer functions between stored values and linear light.

/// `magnitude`, which is not negative, with the signs of v.
fn with_sign(magnitude: vec3f, v: vec3f) -> vec3f {
    return bitcast<vec3f>(bitcast<vec3u>(magnitude) | (bitcast<vec3u>(v) & vec3u(0x80000000u)));
}

/// IEC 61966-2-1, odd about 0 so that negative values survive.
fn srgb_to_linear(v: vec3f) -> vec3f {
    let a = abs(v);
    let low = a * (1.0 / 12.92);
    // In this form 1 becomes exactly 1.
    let high = pow(a * (1.0 / 1.055) + 0.055 / 1.055, vec3f(2.4));
    return with_sign(select(high, low, a <= vec3f(0.04045)), v);
}

/// The inverse of `srgb_to_linear`.
fn linear_to_srgb(v: vec3f) -> vec3f {
    let a = abs(v);
    let low = a * 12.92;
    let high = 1.055 * pow(a, vec3f(1.0 / 2.4)) - 0.055;
    return with_sign(select(high, low, a <= vec3f(0.0031308)), v);
}

/// |v|^p with the sign of v.
fn gamma_transfer(v: vec3f, p: f32) -> vec3f {
    return with_sign(pow(abs(v), vec3f(p)), v);
}
