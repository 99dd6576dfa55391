//! Weights of the Gaussian and the passes of a separable convolution.

use pipe_graph::prelude::*;

use crate::filters::recursive::recursive;
use crate::shader;

/// The radius beyond which the Gaussian is cut: ceil(3σ).
pub(crate) fn radius(sigma: f32) -> u32 {
    (3.0 * sigma).ceil() as u32
}

/// exp(−k²/2σ²), k = −R..R, normalised to sum 1, in double precision. σ = 0 is a single tap.
pub(crate) fn weights(sigma: f32, radius: u32) -> Vec<f64> {
    let (s, r) = (f64::from(sigma), i64::from(radius));
    let raw: Vec<f64> =
        (-r..=r).map(|k| if s > 0.0 { (-((k * k) as f64) / (2.0 * s * s)).exp() } else { f64::from(u8::from(k == 0)) }).collect();
    let sum: f64 = raw.iter().sum();
    raw.into_iter().map(|w| w / sum).collect()
}

/// The axis of a one-dimensional filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Axis {
    /// Along rows.
    X,
    /// Along columns.
    Y,
}

/// Declares a one-dimensional convolution of `image` into `out`.
pub(super) fn convolve(cx: &mut Lowering<'_>, suffix: &str, axis: Axis, weights: &[f64], image: ResourceId, out: ResourceId) {
    let radius = (weights.len() / 2) as u32;
    let table = cx.floats(&format!("{suffix}weights"), &weights.iter().map(|w| *w as f32).collect::<Vec<_>>());
    let (reach, shader) = match axis {
        Axis::X => (Reach::Around(radius, 0), shader!("filters/blur_rows")),
        Axis::Y => (Reach::Around(0, radius), shader!("filters/blur_columns")),
    };
    let size = cx.image_of(out).size;
    // Columns are walked by threads that make several pixels below each other from the same taps.
    let (grid, each) = match axis {
        Axis::X => (Grid::Cover, 1),
        Axis::Y => (Grid::Elements([size[0], size[1].div_ceil(ROWS), 1]), ROWS),
    };
    let entry = if axis == Axis::X { Entry::At } else { Entry::Each };
    cx.pass(suffix, shader)
        .entry(entry)
        .grid(grid)
        .read("image", image, reach)
        .read("weights", table, Reach::Whole)
        .write("out", out)
        .constant("RADIUS", radius as i32)
        .constant("ROWS", each as i32)
        .add();
}

/// Pixels below each other that one thread of a column filter makes.
const ROWS: u32 = 8;

/// A separable blur of `image` into `out`.
pub(super) fn separable(cx: &mut Lowering<'_>, prefix: &str, sigma: [f32; 2], image: ResourceId, out: ResourceId) {
    let (wx, wy) = (weights(sigma[0], radius(sigma[0])), weights(sigma[1], radius(sigma[1])));
    let shape = cx.shape(out);
    let rows = cx.intermediate(&format!("{prefix}rows"), shape);
    convolve(cx, &format!("{prefix}rows"), Axis::X, &wx, image, rows);
    convolve(cx, &format!("{prefix}columns"), Axis::Y, &wy, rows, out);
}

/// The radius up to which two convolutions are faster than the recursive filter, whose cost does not depend on σ.
const SEPARABLE_UP_TO: u32 = 24;

/// The fastest Gaussian blur of `image` into `out`: exact while σ is small, recursive beyond.
pub(super) fn blur(cx: &mut Lowering<'_>, prefix: &str, sigma: [f32; 2], image: ResourceId, out: ResourceId) {
    if sigma.iter().all(|s| radius(*s) <= SEPARABLE_UP_TO) {
        separable(cx, prefix, sigma, image, out);
    } else {
        recursive(cx, prefix, sigma, image, out);
    }
}

/// The twin of a one-dimensional convolution.
pub(super) fn convolve_reference(image: &Raster, axis: Axis, weights: &[f64], border: Border) -> Raster {
    let r = (weights.len() / 2) as i64;
    Raster::from_fn(image.size, image.channels, |x, y| {
        let mut sum = [0.0; 4];
        for (i, w) in weights.iter().enumerate() {
            let k = i as i64 - r;
            // out(x) = Σ w(k)·in(x − k); Gaussian weights are symmetric, given ones need not be.
            let p = match axis {
                Axis::X => image.load(x - k, y, border),
                Axis::Y => image.load(x, y - k, border),
            };
            for c in 0..4 {
                sum[c] += w * p[c];
            }
        }
        sum
    })
}

/// The twin of a separable blur.
pub(super) fn separable_reference(image: &Raster, sigma: [f32; 2], border: Border) -> Raster {
    let rows = convolve_reference(image, Axis::X, &weights(sigma[0], radius(sigma[0])), border);
    convolve_reference(&rows, Axis::Y, &weights(sigma[1], radius(sigma[1])), border)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy.ndimage.gaussian_filter1d(delta, 1.0, truncate=3.0)
    #[test]
    fn weights_are_those_of_scipy() {
        let expected = [0.004_433_05, 0.054_005_58, 0.242_036_23, 0.399_050_28, 0.242_036_23, 0.054_005_58, 0.004_433_05];
        let got = weights(1.0, radius(1.0));
        assert!(got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7), "{got:?}");
        assert_eq!(weights(0.0, 0), [1.0]);
    }
}
