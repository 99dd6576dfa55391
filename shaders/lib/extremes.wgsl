// Minimum and maximum that a NaN on either side survives; WGSL leaves that to the device.

/// The smaller of each pair of components; NaN where either is NaN.
fn minimum(a: vec4f, b: vec4f) -> vec4f {
    return select(min(a, b), a + b, not_numbers(a) | not_numbers(b));
}

/// The larger of each pair of components; NaN where either is NaN.
fn maximum(a: vec4f, b: vec4f) -> vec4f {
    return select(max(a, b), a + b, not_numbers(a) | not_numbers(b));
}

/// Which components are NaN.
fn not_numbers(v: vec4f) -> vec4<bool> {
    return (bitcast<vec4u>(v) & vec4u(0x7fffffffu)) > vec4u(0x7f800000u);
}
