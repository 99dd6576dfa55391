// The remainder that rounds down, without the error of a rounded quotient.

import package::lib::number::is_nan;
import package::lib::wide::{LARGEST_FLOAT, two_product};

/// x − y·⌊x/y⌋, which has the sign of y; 0 where y = 0. Right to the last place while |x/y| < 2^24.
fn floor_remainder(x: f32, y: f32) -> f32 {
    if is_nan(x) || is_nan(y) {
        return x + y;
    }
    if y == 0.0 {
        return 0.0;
    }
    // The rounded quotient may have reached the next whole number: then the remainder has the wrong sign.
    let p = two_product(floor(x / y), y);
    let r = min(x - p.x, LARGEST_FLOAT) - p.y;
    if r != 0.0 && (r < 0.0) != (y < 0.0) {
        return r + y;
    }
    if abs(r) >= abs(y) {
        return r - y;
    }
    return r;
}
