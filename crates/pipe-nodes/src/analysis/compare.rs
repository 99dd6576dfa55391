//! `Compare`: how far two images are from each other.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::reduction::{self, Mean, mean_reference};
use super::{flip, ssim};
use crate::shader;

/// How far two images of one size are from each other: one number for all, and an image of where.
///
/// Alpha takes no part. Values that are not finite take no part in the number.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Compare {
    /// One image; the reference, where it matters.
    a: In<Image>,
    /// The other image.
    b: In<Image>,
    /// What is measured. `Mse`: the mean of the squared differences of all colour channels. `Psnr`: the same in
    /// decibels, 10·log10(peak²/Mse), at most 200 dB, which equal images have. `Ssim`: the mean structural similarity of
    /// the luminances (Wang et al. 2004: Gaussian window, 11 taps, σ = 1.5), 1 for equal images. `Flip`: the mean
    /// of the perceived difference (Andersson et al. 2020, LDR-FLIP), 0 for equal images; values are clipped to 0..1, NaN is black.
    metric: Metric,
    /// The value of white: the peak of `Psnr` and the range of `Ssim`.
    #[default = 1.0]
    #[schemars(range(min = 1e-6, max = 1e6))]
    peak: f32,
    /// Pixels a degree of the visual field, for `Flip`. 67 is a 4K display, 0.7 m wide, seen from 0.7 m.
    #[default = 67.0206]
    #[schemars(range(min = 1.0, max = 200.0), extend("x-unit" = "px/deg"))]
    pixels_per_degree: f32,
}

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
enum Metric {
    /// Mean squared error.
    #[default]
    Mse,
    /// Peak signal-to-noise ratio.
    Psnr,
    /// Structural similarity.
    Ssim,
    /// Perceived difference.
    Flip,
}

pub(crate) const KIND: Kind = Kind::of::<Compare>(
    "Compare",
    Category::Analysis,
    &[
        r#"Compare(a: "in", b: "other")"#,
        r#"Compare(a: "in", b: "other", metric: Psnr, peak: 4)"#,
        r#"Compare(a: "grey", b: "other", metric: Psnr)"#,
        r#"Compare(a: "in", b: "other", metric: Ssim)"#,
        r#"Compare(a: "pair", b: "grey", metric: Ssim, peak: 2)"#,
        r#"Compare(a: "in", b: "other", metric: Flip)"#,
        r#"Compare(a: "grey", b: "in", metric: Flip, pixels_per_degree: 20)"#,
    ],
)
.tolerance(1e-3, 1e-4)
.ports(&[
    ("out", "the number: a Scalar"),
    (
        "difference",
        "where: |a − b| for `Mse` and `Psnr` (alpha 1), and of 1 channel 1 − similarity for `Ssim`, the perceived difference for `Flip`",
    ),
]);

/// PSNR of equal images.
const MOST_DECIBELS: f32 = 200.0;

impl Node for Compare {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let joined = inputs.same_size(&[("a", &self.a), ("b", &self.b)])?;
        let channels = if self.by_channel() { joined.channels } else { 1 };
        Ok(vec![Output::new("out", EdgeType::scalar(1)), Output::new("difference", EdgeType::image(joined.size, channels))])
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (a, b) = (cx.input(&self.a), cx.input(&self.b));
        let (out, difference) = (cx.output("out"), cx.output("difference"));
        let channels = cx.image_of(difference).channels;
        match self.metric {
            Metric::Mse | Metric::Psnr => {
                cx.pass("difference", shader!("analysis/difference"))
                    .entry(Entry::Point)
                    .read("a", a, Reach::Point)
                    .read("b", b, Reach::Point)
                    .write("out", difference)
                    .add();
            }
            Metric::Ssim => ssim::lower(cx, a, b, difference, self.peak),
            Metric::Flip => flip::lower(cx, a, b, difference, self.pixels_per_degree),
        }
        let mean = if self.by_channel() {
            reduction::mean_square(cx, "mean", difference)
        } else {
            reduction::mean(cx, "mean", difference, Mean::Arithmetic, 0.0, false)
        };
        cx.pass("", shader!("analysis/compare"))
            .entry(Entry::Kernel)
            .read("mean", mean, Reach::Whole)
            .write("out", out)
            .constant("METRIC", self.metric as i32)
            .constant("CHANNELS", i32::from(channels.min(3)))
            .param("peak", self.peak)
            .param("most", MOST_DECIBELS)
            .grid(Grid::Groups([1, 1, 1]))
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (a, b) = (cx.image(&self.a), cx.image(&self.b));
        let channels = if self.by_channel() { a.channels.max(b.channels) } else { 1 };
        let difference = match self.metric {
            Metric::Mse | Metric::Psnr => Raster::from_fn(a.size, channels, |x, y| {
                let (p, q) = (a.at(x, y), b.at(x, y));
                [(p[0] - q[0]).abs(), (p[1] - q[1]).abs(), (p[2] - q[2]).abs(), 1.0]
            }),
            Metric::Ssim => ssim::reference(a, b, cx.border, f64::from(self.peak)),
            Metric::Flip => flip::reference(a, b, f64::from(self.pixels_per_degree)),
        };
        let compared = usize::from(channels.min(3));
        let mean = |f: &dyn Fn(f64) -> f64| {
            let of = |c: usize| {
                let values: Vec<_> = difference.pixels.iter().map(|p| f(p[c])).filter(|v| v.is_finite()).collect();
                mean_reference(&values, Mean::Arithmetic, 0.0)
            };
            (0..compared).map(of).sum::<f64>() / compared as f64
        };
        let mse = mean(&|d| d * d);
        let value = match self.metric {
            Metric::Mse => mse,
            Metric::Psnr => (10.0 * (f64::from(self.peak).powi(2) / mse).log10()).min(f64::from(MOST_DECIBELS)),
            Metric::Ssim => 1.0 - mean(&|d| d),
            Metric::Flip => mean(&|d| d),
        };
        vec![Tensor::Scalar(vec![value]), Tensor::Image(difference)]
    }
}

impl Compare {
    /// Whether the difference has the channels of the images.
    const fn by_channel(&self) -> bool {
        matches!(self.metric, Metric::Mse | Metric::Psnr)
    }
}
