// Powers of any real base: WGSL leaves pow of a negative base undefined.

import package::lib::number::is_nan;

/// x^y as IEEE 754 has it: of a negative x defined for whole y, NaN otherwise.
fn real_power(x: f32, y: f32) -> f32 {
    if y == 0.0 {
        return 1.0;
    }
    if is_nan(x) || is_nan(y) {
        return x + y;
    }
    if x == 0.0 {
        // 1/0 through a value that is not known when the shader is compiled.
        return select(1.0 / abs(x), 0.0, y > 0.0);
    }
    if x > 0.0 {
        return pow(x, y);
    }
    if y != trunc(y) {
        // sqrt of a negative number is the NaN that every device has.
        return sqrt(x);
    }
    let magnitude = pow(-x, y);
    let odd = abs(y) < 16777216.0 && (i32(y) & 1) == 1;
    return select(magnitude, -magnitude, odd);
}
