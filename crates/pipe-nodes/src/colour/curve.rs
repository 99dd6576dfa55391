//! Curves that map scaled luminance to the display: one formula each, for shader and twin.

use pipe_graph::prelude::*;

/// How luminance is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub(super) enum Operator {
    /// D = Yr(1 + Yr/W²)/(1 + Yr): Reinhard et al. 2002, equation 4.
    #[default]
    Reinhard,
    /// D = Yr/(1 + Yr): equation 3.
    ReinhardSimple,
    /// J. Hable's curve for Uncharted 2 (2010), on luminance: D = h(Yr)/h(W).
    Hable,
    /// K. Narkowicz's fit of the ACES curve (2015), on each channel of the scaled colour.
    AcesFit,
    /// AgX by T. Sobotka, as the polynomial fit of B. Wrensch (2023), on the scaled colour; linear light again.
    AgX,
    /// D = Yr, clamped nowhere.
    Linear,
}

/// What a smaller average counts as: an average of 0 must not make black NaN.
pub(super) const LEAST_AVERAGE: f64 = 1e-30;

/// How near to its pole Reinhard's curve is followed.
const LEAST_DENOMINATOR: f64 = 1e-6;

/// Hable's curve before it is normalised.
fn hable(x: f64) -> f64 {
    let (a, b, c, d, e, f) = (0.15, 0.50, 0.10, 0.20, 0.02, 0.30);
    (x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f
}

fn aces(x: f64) -> f64 {
    ((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)
}

fn agx(c: [f64; 3]) -> [f64; 3] {
    const IN: [[f64; 3]; 3] = [
        [0.842_479_062_253_094, 0.078_433_599_999_999_2, 0.079_223_745_147_764_3],
        [0.042_328_242_261_012_3, 0.878_468_636_469_772, 0.079_166_127_460_543_4],
        [0.042_375_654_905_705_1, 0.078_433_600_000_000, 0.879_142_973_793_104],
    ];
    const OUT: [[f64; 3]; 3] = [
        [1.196_879_005_120_17, -0.098_020_881_140_136_8, -0.099_029_744_079_720_5],
        [-0.052_896_851_757_456_2, 1.151_903_129_904_17, -0.098_961_176_844_843_3],
        [-0.052_971_635_514_443_8, -0.098_043_450_117_124_1, 1.151_073_672_641_16],
    ];
    let times = |m: &[[f64; 3]; 3], v: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| (0..3).map(|j| m[i][j] * v[j]).sum()) };
    let shaped = times(&IN, c).map(|v| {
        let (low, high) = (-12.473_93, 4.026_069);
        let x = ((v.max(1e-10).log2().clamp(low, high)) - low) / (high - low);
        let (x2, x4) = (x * x, x * x * x * x);
        15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.429_8 * x2 + 0.119_1 * x - 0.002_32
    });
    times(&OUT, shaped).map(|v| v.max(0.0).powf(2.2))
}

/// A denominator that is kept from 0: Reinhard's curve has a pole at Yr = −1, where only noise and interpolation lead.
fn off_zero(v: f64) -> f64 {
    if v.abs() < LEAST_DENOMINATOR { LEAST_DENOMINATOR.copysign(v) } else { v }
}

/// The tone-mapped colour of one pixel: Yr = α·Y/Y′ through the operator; 0 where Y = 0.
pub(super) fn tone_map(rgb: [f64; 3], average: f64, key: f64, white: f64, operator: Operator) -> [f64; 3] {
    let y = luminance([rgb[0], rgb[1], rgb[2], 1.0]);
    if y == 0.0 {
        return [0.0; 3];
    }
    if y.is_nan() {
        return [y; 3];
    }
    let scale = key / average.max(LEAST_AVERAGE);
    let yr = y * scale;
    let by = |d: f64| rgb.map(|v| v * (d / y));
    let by_rational = |numerator: f64| rgb.map(|v| v * scale * (numerator / off_zero(1.0 + yr)));
    match operator {
        Operator::Reinhard => by_rational(1.0 + yr / (white * white)),
        Operator::ReinhardSimple => by_rational(1.0),
        Operator::Hable => by(yr.signum() * hable(yr.abs()) / hable(white)),
        Operator::AcesFit => rgb.map(|v| aces((v * scale).max(0.0))),
        Operator::AgX => agx(rgb.map(|v| v * scale)),
        Operator::Linear => by(yr),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapped(y: f64, white: f64, operator: Operator) -> f64 {
        tone_map([y; 3], 0.18, 0.18, white, operator)[1]
    }

    #[test]
    fn white_is_mapped_to_one() {
        for operator in [Operator::Reinhard, Operator::Hable] {
            assert!((mapped(4.0, 4.0, operator) - 1.0).abs() < 1e-12);
        }
        assert_eq!(mapped(1.0, 4.0, Operator::ReinhardSimple), 0.5);
        assert_eq!(mapped(0.0, 4.0, Operator::AgX), 0.0);
    }

    /// From the formulas as published (Hable with exposure bias 2 and W = 11.2), computed with NumPy.
    #[test]
    fn curves_at_points_that_are_known() {
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-8, "{a}, expected {b}");
        close(hable(11.2), 0.725_129_378_4);
        close(mapped(2.0, 11.2, Operator::Hable), 0.492_918_546_0);
        close(mapped(1.0, 4.0, Operator::AcesFit), 0.803_797_468_4);
        let colour = agx([1.0, 0.5, 0.1]);
        [0.624_149_97, 0.439_084_01, 0.174_696_53].iter().zip(colour).for_each(|(a, b)| close(*a, b));
    }

    #[test]
    fn negative_light_follows_the_formula_and_the_pole_is_finite() {
        assert!((mapped(-0.5, 4.0, Operator::ReinhardSimple) + 1.0).abs() < 1e-12);
        assert!((mapped(-2.0, 4.0, Operator::Reinhard) - 2.0 * (1.0 - 2.0 / 16.0)).abs() < 1e-12);
        assert!(mapped(-1.0, 4.0, Operator::Reinhard).is_finite());
    }
}
