// What a medium lets through.

/// What part of the light does not pass an optical depth: 1 − e^−x, to the last digits also where it is small.
fn stopped(x: f32) -> f32 {
    return select(1.0 - exp(-x), x * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x / 24.0))), x < 0.1);
}
