//! A Gaussian that is cheaper the wider it is: the image is halved, blurred small, and interpolated.
//!
//! Each halving is a binomial filter (1 4 6 4 1)/16 of variance 1 (P. Burt, Fast Filter Transforms for Image Processing,
//! 1981), the way back one cubic B-spline of variance 1/3 of a coarse pixel squared, and variances add: after n halvings the
//! Gaussian in between has σ′² = σ²/4ⁿ − (1 − 4⁻ⁿ)/3 − 1/3. A small image is left while σ/2ⁿ ≥ 2. Then no weight of an axis
//! differs from the Gaussian's so much that an image of range 1 could be off by more than 4.1e-4 (half the sum of the
//! absolute differences, the worst of all positions); both axes stay below 1e-3.
//!
//! The coarse images are larger than the image: as far around it as the Gaussian reaches, the border policy is followed in
//! full size, so that the edges of the result are as right as its middle. The axes go down and up independently.

use pipe_graph::prelude::*;

use crate::filters::gaussian::{Axis, convolve, wide_weights};
use crate::filters::recursive::recursive;
use crate::shader;

/// The least σ in coarse pixels, binomials and spline included.
const LEAST_COARSE_SIGMA: f64 = 2.0;

/// The samples of one level: they stand 2ˡ pixels apart, the first at 2ˡ·first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Level {
    first: i32,
    len: u32,
}

/// How one axis goes down.
#[derive(Debug)]
struct Descent {
    /// The image first, the coarsest last.
    levels: Vec<Level>,
    /// The blur of the coarsest.
    weights: Vec<f64>,
}

impl Descent {
    fn new(sigma: f32, len: u32) -> Self {
        let image = Level { first: 0, len };
        let s = f64::from(sigma);
        let halvings = (s / LEAST_COARSE_SIGMA).log2().floor().max(0.0) as i32;
        if halvings == 0 {
            return Self { levels: vec![image], weights: wide_weights(sigma) };
        }
        let scale = 4_f64.powi(halvings);
        let weights = wide_weights(((s * s + 1.0 / 3.0) / scale - 2.0 / 3.0).sqrt() as f32);
        let radius = (weights.len() / 2) as i32;
        // The spline looks at one sample before a pixel and two behind it, each of them a blur over `radius`.
        let (mut first, mut last) = (-1 - radius, ((len - 1) >> halvings) as i32 + 2 + radius);
        let mut levels = Vec::new();
        for _ in 0..halvings {
            levels.push(Level { first, len: (last - first + 1) as u32 });
            (first, last) = (2 * first - 2, 2 * last + 2);
        }
        levels.push(image);
        levels.reverse();
        Self { levels, weights }
    }

    fn halvings(&self) -> usize {
        self.levels.len() - 1
    }

    fn coarsest(&self) -> Level {
        self.levels[self.halvings()]
    }
}

/// Declares the blur.
pub(super) fn pyramid(cx: &mut Lowering<'_>, sigma: [f32; 2], image: ResourceId, out: ResourceId) {
    let ImageType { size, channels, .. } = cx.image_of(image);
    let axes = [(Axis::X, Descent::new(sigma[0], size[0])), (Axis::Y, Descent::new(sigma[1], size[1]))];
    let widest = axes.iter().flat_map(|(_, d)| &d.levels).map(|l| l.len).max();
    if widest > Some(cx.limits().max_image) {
        // A short but very wide blur of an image as large as the device allows.
        return recursive(cx, sigma, image, out);
    }
    let mut at = size;
    let mut from = image;
    for (axis, descent) in &axes {
        for (i, pair) in descent.levels.windows(2).enumerate() {
            at[*axis as usize] = pair[1].len;
            let to = cx.intermediate(&format!("{axis:?}{}", i + 1), Shape::image(at, channels));
            halve(cx, *axis, i, [pair[0], pair[1]], [from, to]);
            from = to;
        }
    }
    let mut left = axes.iter().filter(|(_, d)| d.halvings() > 0).count();
    for (i, (axis, descent)) in axes.iter().enumerate() {
        let to = if i == 1 && left == 0 { out } else { cx.intermediate(&format!("blurred{axis:?}"), Shape::image(at, channels)) };
        convolve(cx, &format!("blur{axis:?}"), *axis, &descent.weights, from, to);
        from = to;
    }
    for (axis, descent) in axes.iter().filter(|(_, d)| d.halvings() > 0) {
        at[*axis as usize] = size[*axis as usize];
        left -= 1;
        let to = if left == 0 { out } else { cx.intermediate(&format!("expanded{axis:?}"), Shape::image(at, channels)) };
        expand(cx, *axis, descent, [from, to]);
        from = to;
    }
}

fn halve(cx: &mut Lowering<'_>, axis: Axis, i: usize, [fine, coarse]: [Level; 2], [from, to]: [ResourceId; 2]) {
    cx.pass(&format!("halve{axis:?}{}", i + 1), shader!("filters/pyramid_halve"))
        .read("image", from, Reach::Whole)
        .write("out", to)
        .constant("ALONG_X", axis == Axis::X)
        .param("shift", 2 * coarse.first - fine.first)
        .add();
}

fn expand(cx: &mut Lowering<'_>, axis: Axis, descent: &Descent, [from, to]: [ResourceId; 2]) {
    cx.pass(&format!("expand{axis:?}"), shader!("filters/pyramid_expand"))
        .read("image", from, Reach::Whole)
        .write("out", to)
        .constant("ALONG_X", axis == Axis::X)
        .constant("HALVINGS", descent.halvings() as u32)
        .param("shift", -descent.coarsest().first)
        .add();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filters::gaussian::weights;
    use std::collections::BTreeMap;

    const BINOMIAL: [f64; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];

    /// The weights that pixel x of the image gets, from position x − reach on.
    fn response(descent: &Descent, x: i64, reach: i64) -> Vec<f64> {
        let halvings = descent.halvings() as u32;
        let f = (x & ((1 << halvings) - 1)) as f64 / f64::from(1 << halvings);
        let g = 1.0 - f;
        let spline = [g.powi(3), 4.0 - 6.0 * f * f + 3.0 * f.powi(3), 4.0 - 6.0 * g * g + 3.0 * g.powi(3), f.powi(3)].map(|w| w / 6.0);
        let radius = (descent.weights.len() / 2) as i64;
        // Weights by coordinate, of the coarsest level and then of ever finer ones.
        let mut level: BTreeMap<i64, f64> = BTreeMap::new();
        for (i, s) in spline.iter().enumerate() {
            for (k, w) in descent.weights.iter().enumerate() {
                *level.entry((x >> halvings) + i as i64 - 1 + k as i64 - radius).or_default() += s * w;
            }
        }
        for _ in 0..halvings {
            let mut finer: BTreeMap<i64, f64> = BTreeMap::new();
            for (c, w) in level {
                for (t, b) in BINOMIAL.iter().enumerate() {
                    *finer.entry(2 * c + t as i64 - 2).or_default() += w * b;
                }
            }
            level = finer;
        }
        (x - reach..=x + reach).map(|c| level.get(&c).copied().unwrap_or(0.0)).collect()
    }

    /// No image of range 1 can be off by more than half the sum of the absolute differences of the weights.
    #[test]
    fn weights_are_near_the_gaussian_at_every_position() {
        for sigma in [4.0_f32, 5.5, 7.9, 8.0, 13.0, 31.0, 64.0, 100.0] {
            let descent = Descent::new(sigma, 4096);
            let reach = (10.0 * sigma).ceil() as i64 + 8;
            let exact = weights(sigma, reach as u32);
            let worst = (0..1 << descent.halvings())
                .map(|x| response(&descent, 2048 + x, reach).iter().zip(&exact).map(|(a, b)| (a - b).abs()).sum::<f64>() / 2.0)
                .fold(0.0, f64::max);
            assert!(worst < 4.1e-4, "σ {sigma}: {worst}");
        }
    }

    #[test]
    fn levels_hold_what_is_asked_of_them() {
        for len in [1, 2, 61, 4096] {
            let descent = Descent::new(50.0, len);
            for pair in descent.levels[1..].windows(2) {
                let [fine, coarse] = [pair[0], pair[1]];
                assert!(2 * coarse.first - 2 >= fine.first);
                assert!(2 * (coarse.first + coarse.len as i32 - 1) + 2 < fine.first + fine.len as i32);
            }
        }
    }
}
