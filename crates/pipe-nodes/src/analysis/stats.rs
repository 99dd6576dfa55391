//! `Stats`: what an image holds, in numbers.

use pipe_graph::prelude::*;

use super::quantile::{quantile_reference, quantiles};
use super::reduction::{self, Mean, View, finite_values, view};

/// The statistics of an image, each a Scalar. Of a colour image the four components are R, G, B and the luminance
/// Y = 0.2126 R + 0.7152 G + 0.0722 B (alpha is left out); of an image of one or two channels, its channels.
///
/// NaN and infinite values are counted and left out of everything else. Without any finite value the statistics
/// are 0. Only what is used is computed: the percentiles together take five passes over the image, everything else
/// one, which other reductions of the image share.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Stats {
    /// The image to measure.
    image: In<Image>,
}

pub(crate) const KIND: Kind =
    Kind::of::<Stats>("Stats", Category::Analysis, &[r#"Stats(image: "in")"#, r#"Stats(image: "grey")"#, r#"Stats(image: "pair")"#]).ports(
        &[
            ("min", "the smallest value"),
            ("max", "the largest value"),
            ("mean", "the arithmetic mean"),
            ("stddev", "the standard deviation of the population, √(Σ(v − mean)²/n)"),
            ("median", "the value that half of the pixels stay below; between two values, their mean"),
            ("p01", "the 1st percentile, interpolated linearly between pixels as `numpy.percentile` does"),
            ("p99", "the 99th percentile"),
            ("nan_count", "how many values are not a number"),
            ("inf_count", "how many values are infinite"),
        ],
    );

/// The quantiles behind `median`, `p01` and `p99`.
const FRACTIONS: [(&str, f64); 3] = [("median", 0.5), ("p01", 0.01), ("p99", 0.99)];

impl Node for Stats {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let components = inputs.image(&self.image).channels;
        let port = |(name, _): &(&str, &str)| Output::new(*name, EdgeType::Scalar(ScalarType { components }));
        Ok(KIND.ports.iter().map(port).collect())
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        let view = seen(cx.image_of(image).channels);
        let extent = reduction::extent(cx, "extent", image, view);
        let mean = reduction::mean_of(cx, "mean", image, Mean::Arithmetic, 0.0, view);
        let deviation = reduction::deviation(cx, "stddev", image, view);
        let found = quantiles(cx, "percentile", image, view, &FRACTIONS.map(|(_, fraction)| fraction));
        cx.emit("min", extent.min);
        cx.emit("max", extent.max);
        cx.emit("mean", mean);
        cx.emit("stddev", deviation);
        for ((port, _), quantile) in FRACTIONS.iter().zip(found) {
            cx.emit(port, quantile);
        }
        cx.emit("nan_count", extent.nan);
        cx.emit("inf_count", extent.inf);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let pixels = view(image, seen(image.channels));
        let of_components = |f: &dyn Fn(usize) -> f64| Tensor::Scalar((0..usize::from(image.channels)).map(f).collect());
        let of_values = |f: &dyn Fn(&[f64]) -> f64| of_components(&|c| f(&finite_values(&pixels, c)));
        let count = |is: &dyn Fn(f64) -> bool| of_components(&|c| pixels.iter().filter(|p| is(p[c])).count() as f64);
        let mean = |v: &[f64]| reduction::mean_reference(v, Mean::Arithmetic, 0.0);
        let variance = |v: &[f64]| mean(&v.iter().map(|x| (x - mean(v)).powi(2)).collect::<Vec<_>>());
        vec![
            of_values(&|v| v.iter().copied().reduce(f64::min).unwrap_or(0.0)),
            of_values(&|v| v.iter().copied().reduce(f64::max).unwrap_or(0.0)),
            of_values(&mean),
            of_values(&|v| variance(v).sqrt()),
            of_values(&|v| quantile_reference(v, 0.5)),
            of_values(&|v| quantile_reference(v, 0.01)),
            of_values(&|v| quantile_reference(v, 0.99)),
            count(&f64::is_nan),
            count(&f64::is_infinite),
        ]
    }
}

/// Alpha is no light: a colour image shows its luminance in its place.
const fn seen(channels: u8) -> View {
    if channels == 4 { View::ColourAndLuminance } else { View::Channels }
}
