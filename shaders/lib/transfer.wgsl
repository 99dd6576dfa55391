// Transfer functions between stored values and linear light.

/// IEC 61966-2-1, odd about 0 so that negative values survive.
fn srgb_to_linear(v: vec3f) -> vec3f {
    let a = abs(v);
    let low = a / 12.92;
    let high = pow((a + 0.055) / 1.055, vec3f(2.4));
    return sign(v) * select(high, low, a <= vec3f(0.04045));
}

/// The inverse of `srgb_to_linear`.
fn linear_to_srgb(v: vec3f) -> vec3f {
    let a = abs(v);
    let low = a * 12.92;
    let high = 1.055 * pow(a, vec3f(1.0 / 2.4)) - 0.055;
    return sign(v) * select(high, low, a <= vec3f(0.0031308));
}

/// |v|^p with the sign of v.
fn gamma_transfer(v: vec3f, p: f32) -> vec3f {
    return sign(v) * pow(abs(v), vec3f(p));
}
