// Half floats as bits, in integer arithmetic: the same result on every device, subnormals included.
// `pack2x16float` and its inverse may flush subnormals, and are slow on CPU devices.

/// The value of the half float in the low 16 bits.
fn half_to_float(h: u32) -> f32 {
    let sign = (h & 0x8000u) << 16u;
    let exponent = (h >> 10u) & 0x1fu;
    let mantissa = h & 0x3ffu;
    if exponent == 0u {
        let magnitude = f32(mantissa) * 5.9604644775390625e-8;
        return bitcast<f32>(sign | bitcast<u32>(magnitude));
    }
    if exponent == 31u {
        return bitcast<f32>(sign | 0x7f800000u | (mantissa << 13u));
    }
    return bitcast<f32>(sign | ((exponent + 112u) << 23u) | (mantissa << 13u));
}

/// The nearest half float, ties to even, as the low 16 bits; too large becomes infinity, NaN stays NaN.
fn float_to_half(v: f32) -> u32 {
    let bits = bitcast<u32>(v);
    let sign = (bits >> 16u) & 0x8000u;
    let magnitude = bits & 0x7fffffffu;
    if magnitude > 0x7f800000u {
        return sign | 0x7e00u;
    }
    if magnitude >= 0x477ff000u {
        return sign | 0x7c00u;
    }
    if magnitude < 0x38800000u {
        // Below 2^-14: a multiple of 2^-24. Shift the significand, rounding to nearest even.
        let shift = 126u - (magnitude >> 23u);
        if shift > 24u {
            return sign;
        }
        let significand = (magnitude & 0x7fffffu) | 0x800000u;
        let kept = significand >> shift;
        let rest = significand & ((1u << shift) - 1u);
        let half = 1u << (shift - 1u);
        let up = select(0u, 1u, rest > half || (rest == half && (kept & 1u) == 1u));
        return sign | (kept + up);
    }
    let rounded = magnitude + 0xfffu + ((magnitude >> 13u) & 1u);
    return sign | ((rounded - 0x38000000u) >> 13u);
}
