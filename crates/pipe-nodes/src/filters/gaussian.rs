//! Weights of the Gaussian and the passes of a separable convolution.

use pipe_graph::pass::Limits;
use pipe_graph::prelude::*;

use crate::filters::recursive::recursive_axis;
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
    let width = cx.image_of(out).size[0];
    let stage = if axis == Axis::X && cx.limits().profile == Profile::Gpu { Stage::new(radius, width) } else { None };
    let (reach, run) = match axis {
        Axis::X => (Reach::Around(radius, 0), [RUN, 1]),
        Axis::Y => (Reach::Around(0, radius), [1, RUN]),
    };
    let table = cx.floats(&format!("{suffix}weights"), &weights.iter().map(|w| *w as f32).collect::<Vec<_>>());
    let pass = match stage {
        Some(stage) => cx
            .pass(suffix, shader!("filters/blur_rows_staged"))
            .entry(Entry::Kernel)
            .grid(Grid::Blocks(stage.tile))
            .constant("WIDTH", stage.tile[0] as i32)
            .constant("HEIGHT", stage.tile[1] as i32)
            .constant("QUADS", stage.quads as i32),
        None => cx
            .pass(suffix, shader!("filters/blur_run"))
            .entry(Entry::Each)
            .grid(Grid::Blocks(run))
            .constant("ALONG_X", axis == Axis::X)
            .constant("RUN", RUN as i32),
    };
    pass.read("image", image, reach).read("weights", table, Reach::Whole).write("out", out).constant("RADIUS", radius as i32).add();
}

/// Neighbours that one thread makes from the same taps.
const RUN: u32 = 8;

/// How a workgroup on a GPU makes a tile of rows: it loads the tile with what is to both sides into its own memory, and a
/// thread makes four neighbouring pixels from the same taps. Neighbours in a row are far apart in a texture's memory, so that
/// threads which walk along x, as those of columns walk down, wait for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stage {
    tile: [u32; 2],
    /// Fours of pixels of a row with its sides. 2 more than a multiple of 4: then eight neighbours, which stand in four
    /// places of two, are in different banks of memory.
    quads: u32,
}

/// Pixels of a tile: 128 threads of four pixels.
const TILE: u32 = 512;

/// Pixels that fit in the 16 KiB of memory which every device gives to a workgroup.
const STAGED: u32 = 1024;

impl Stage {
    /// The tile of the most rows that fits, for textures hold neighbouring rows together; `None` where none fits, where
    /// there is nothing to share, or where the image is too narrow to fill one.
    fn new(radius: u32, width: u32) -> Option<Self> {
        if radius == 0 {
            return None;
        }
        let quads = |width: u32| ((width + 2 * radius).div_ceil(4) + 2).next_multiple_of(4) - 2;
        let fitting = [8, 4, 2, 1].map(|rows| Self { tile: [TILE / rows, rows], quads: quads(TILE / rows) });
        fitting.into_iter().find(|s| s.quads * 4 * s.tile[1] <= STAGED && (s.tile[0] == TILE / 8 || s.tile[0] <= width))
    }
}

/// Weights that are within 1e-4 of the unbounded Gaussian: cut at 4σ.
pub(super) fn wide_weights(sigma: f32) -> Vec<f64> {
    weights(sigma, (4.0 * sigma).ceil() as u32)
}

/// Declares a blur by its two axes; `axis` declares one of them.
pub(super) fn both_axes(
    cx: &mut Lowering<'_>,
    prefix: &str,
    sigma: [f32; 2],
    [image, out]: [ResourceId; 2],
    axis: impl Fn(&mut Lowering<'_>, &str, Axis, f32, [ResourceId; 2]),
) {
    let shape = cx.shape(out);
    let rows = cx.intermediate(&format!("{prefix}rows"), shape);
    axis(cx, &format!("{prefix}rows"), Axis::X, sigma[0], [image, rows]);
    axis(cx, &format!("{prefix}columns"), Axis::Y, sigma[1], [rows, out]);
}

fn exact_axis(cx: &mut Lowering<'_>, suffix: &str, axis: Axis, sigma: f32, [image, out]: [ResourceId; 2]) {
    convolve(cx, suffix, axis, &weights(sigma, radius(sigma)), image, out);
}

/// A separable blur of `image` into `out`.
pub(super) fn separable(cx: &mut Lowering<'_>, prefix: &str, sigma: [f32; 2], image: ResourceId, out: ResourceId) {
    both_axes(cx, prefix, sigma, [image, out], exact_axis);
}

/// The radius up to which a convolution is preferred to the recursive filter, whose cost does not depend on σ. On GPUs it is
/// the faster one up to here. On CPUs the recursive filter is faster from 10 on, and at σ = 8 three times as fast; below
/// that exactness is worth more than the difference. In tiles the convolution looks four times less far around.
const fn separable_up_to(limits: &Limits) -> u32 {
    match limits.profile {
        _ if limits.tiled => 96,
        Profile::Gpu => 24,
        Profile::Cpu => 20,
    }
}

/// The fastest Gaussian blur of `image` into `out`: along each axis exact while σ is small, recursive beyond.
pub(super) fn blur(cx: &mut Lowering<'_>, prefix: &str, sigma: [f32; 2], image: ResourceId, out: ResourceId) {
    let most = separable_up_to(cx.limits());
    both_axes(cx, prefix, sigma, [image, out], |cx, suffix, axis, sigma, ends| {
        if radius(sigma) <= most {
            exact_axis(cx, suffix, axis, sigma, ends);
        } else {
            recursive_axis(cx, suffix, axis, sigma, ends);
        }
    });
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

/// The Gaussian itself, cut only where it is below 1e-14: what `Recursive` and `Pyramid` approximate.
pub(super) fn unbounded_reference(image: &Raster, sigma: [f32; 2], border: Border) -> Raster {
    let [wx, wy] = sigma.map(|s| weights(s, (8.0 * s).ceil() as u32));
    convolve_reference(&convolve_reference(image, Axis::X, &wx, border), Axis::Y, &wy, border)
}

/// The twin of a separable blur.
pub(super) fn separable_reference(image: &Raster, sigma: [f32; 2], border: Border) -> Raster {
    let rows = convolve_reference(image, Axis::X, &weights(sigma[0], radius(sigma[0])), border);
    convolve_reference(&rows, Axis::Y, &weights(sigma[1], radius(sigma[1])), border)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radii of all tiles, and of none.
    #[test]
    fn a_stage_fits_in_workgroup_memory() {
        let wide = |radius| Stage::new(radius, 4096);
        for (radius, rows) in [(1, 8), (28, 8), (29, 4), (60, 4), (61, 2), (124, 2), (125, 1), (252, 1)] {
            assert_eq!(wide(radius).map(|s| s.tile), Some([TILE / rows, rows]), "{radius}");
        }
        assert_eq!([wide(0), wide(253), Stage::new(100, 200)], [None; 3]);
    }

    /// scipy.ndimage.gaussian_filter1d(delta, 1.0, truncate=3.0)
    #[test]
    fn weights_are_those_of_scipy() {
        let expected = [0.004_433_05, 0.054_005_58, 0.242_036_23, 0.399_050_28, 0.242_036_23, 0.054_005_58, 0.004_433_05];
        let got = weights(1.0, radius(1.0));
        assert!(got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7), "{got:?}");
        assert_eq!(weights(0.0, 0), [1.0]);
    }
}
