// Half floats as bits: the same result on every device, subnormals included, and no branches, which CPU devices pay for in
// everything around them. `pack2x16float` and its inverse may flush subnormals, and are slow on CPU devices.

/// The value of the half float in the low 16 bits.
fn half_to_float(h: u32) -> f32 {
    let magnitude = (h & 0x7fffu) << 13u;
    let normal = magnitude + 0x38000000u;
    // m·2^-24 = (1 + m/1024)·2^-14 − 2^-14: no operand is subnormal as a float, and nothing is rounded.
    let subnormal = bitcast<u32>(bitcast<f32>(magnitude + 0x38800000u) - 6.103515625e-5);
    let finite = select(normal, subnormal, magnitude < 0x00800000u);
    let bits = select(finite, magnitude + 0x70000000u, magnitude >= 0x0f800000u);
    return bitcast<f32>(((h & 0x8000u) << 16u) | bits);
}

/// The nearest half float, ties to even, as the low 16 bits; too large becomes infinity, NaN stays NaN.
fn float_to_half(v: f32) -> u32 {
    let bits = bitcast<u32>(v);
    let magnitude = bits & 0x7fffffffu;
    let normal = (magnitude - 0x38000000u + 0xfffu + ((magnitude >> 13u) & 1u)) >> 13u;
    // Below 2^-14: a multiple of 2^-24. Shift the significand, rounding to nearest even; shifted by 25 nothing is left.
    let shift = 126u - clamp(magnitude >> 23u, 101u, 113u);
    let significand = (magnitude & 0x7fffffu) | 0x800000u;
    let subnormal = (significand + (1u << (shift - 1u)) - 1u + ((significand >> shift) & 1u)) >> shift;
    let finite = select(normal, subnormal, magnitude < 0x38800000u);
    let bounded = select(finite, 0x7c00u, magnitude >= 0x477ff000u);
    return ((bits >> 16u) & 0x8000u) | select(bounded, 0x7e00u, magnitude > 0x7f800000u);
}
