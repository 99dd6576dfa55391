// Numbers that compilers and drivers treat differently, treated once.

/// Whether x is not a number. `x != x` does not survive every shader compiler, bits do.
fn is_nan(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u;
}

/// Whether x is a number other than ±infinity.
fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

/// Which components are NaN or ±infinity.
fn not_finite(v: vec4f) -> vec4<bool> {
    return (bitcast<vec4u>(v) & vec4u(0x7f800000u)) == vec4u(0x7f800000u);
}

/// |x|^p with the sign of x; NaN stays NaN. WGSL leaves pow of a negative base undefined.
fn signed_pow(x: f32, p: f32) -> f32 {
    if is_nan(x) || x == 0.0 {
        return x;
    }
    return sign(x) * pow(abs(x), p);
}

/// max(x, 0)^p; NaN stays NaN.
fn safe_pow(x: f32, p: f32) -> f32 {
    if is_nan(x) {
        return x;
    }
    return pow(max(x, 0.0), p);
}
