// Sines that do not depend on the device: WGSL allows an error of 2^-11, which kernels of resampling would show.

/// sin(πx), to a few units in the last place of 1.
fn sin_pi(x: f32) -> f32 {
    let n = round(x);
    let r = x - n;
    let q = r * r;
    // Taylor's series of sin(πr) for |r| ≤ ½.
    let s = r * (3.14159265 + q * (-5.16771278 + q * (2.55016404 + q * (-0.599264529 + q * (0.0821458866 + q * (-0.00737043095 + q * 0.000466302806))))));
    return select(s, -s, (i32(n) & 1) == 1);
}

/// sin(πx)/(πx)
fn sinc(x: f32) -> f32 {
    return select(sin_pi(x) / (3.14159265 * x), 1.0, x == 0.0);
}
