//! Arithmetic of the twins where Rust, IEEE and WGSL differ: NaN in minimum and maximum, division by zero, powers.

/// The smaller; NaN when either is NaN (`f64::min` would drop it).
pub(super) fn minimum(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.min(b) }
}

/// The larger; NaN when either is NaN.
pub(super) fn maximum(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// a/b, 0 where b = 0: as oiiotool and GEGL divide images.
pub(super) fn quotient(a: f64, b: f64) -> f64 {
    if b == 0.0 && !a.is_nan() { 0.0 } else { a / b }
}

/// x − y·⌊x/y⌋, exactly: the remainder with the sign of y (as in Python); 0 where y = 0.
pub(super) fn modulo(x: f64, y: f64) -> f64 {
    if y == 0.0 {
        return 0.0;
    }
    // `%` of Rust is exact and has the sign of x.
    let r = x % y;
    if r != 0.0 && (r < 0.0) != (y < 0.0) { r + y } else { r }
}

/// x^y: of a negative x only for whole y, else 0; 0 to a negative power is 0, as 1/0 is.
pub(super) fn power(x: f64, y: f64) -> f64 {
    if x.is_nan() || y.is_nan() {
        return f64::NAN;
    }
    if (x == 0.0 && y < 0.0) || (x < 0.0 && y != y.trunc()) {
        return 0.0;
    }
    x.powf(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    // Python: -7 % 3, 7 % -3, 5.5 % 2, -6 % 3
    #[test]
    fn modulo_as_python() {
        for (x, y, expected) in [(-7.0, 3.0, 2.0), (7.0, -3.0, -2.0), (5.5, 2.0, 1.5), (-6.0, 3.0, 0.0), (1.0, 0.0, 0.0)] {
            assert_eq!(modulo(x, y), expected, "{x} mod {y}");
        }
    }

    #[test]
    fn powers_stay_finite() {
        for (x, y, expected) in [(-2.0, 3.0, -8.0), (-2.0, 0.5, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (4.0, 0.5, 2.0)] {
            assert_eq!(power(x, y), expected, "{x}^{y}");
        }
    }
}
