//! `Normalize`: stretches values to 0..g_max.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::quantile::{quantile_reference, quantiles};
use super::reduction::{self, View, finite_values, view};
use crate::shader;

/// Stretches the values from low..high to 0..g_max: g_max·(G − low)/(high − low), for every colour channel. Alpha is
/// kept, nothing is clipped. Where low = high the result is 0.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Normalize {
    /// The image to stretch.
    image: In<Image>,
    /// The value that becomes 0, with `from: Given`.
    low: Driven,
    /// The value that becomes `g_max`, with `from: Given`.
    #[default(Driven::Value(1.0))]
    high: Driven,
    /// What `high` becomes: 1 for the display, 255 for eight bits.
    #[default = 1.0]
    g_max: f32,
    /// Where low and high come from. `Given`: the parameters. `MinMax`: the smallest and largest luminance of the
    /// image. `Percentile(lo, hi)`: the luminances below which lo and hi per cent of the pixels lie, interpolated as
    /// `numpy.percentile` does; 0 ≤ lo, hi ≤ 100. They are measured on the GPU; NaN and infinity take no part.
    from: Ends,
}

/// Where the ends of the stretch come from.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
enum Ends {
    /// The parameters `low` and `high`.
    #[default]
    Given,
    /// Smallest and largest luminance.
    MinMax,
    /// Percentiles of the luminance.
    Percentile {
        /// Per cent of the pixels below low.
        lo: f32,
        /// Per cent of the pixels below high.
        hi: f32,
    },
}

pub(crate) const KIND: Kind = Kind::of::<Normalize>(
    "Normalize",
    Category::Colour,
    &[
        r#"Normalize(image: "in", low: 0.25, high: 2.0)"#,
        r#"Normalize(image: "in", low: "scalar", high: 9, g_max: 255)"#,
        r#"Normalize(image: "in", from: MinMax)"#,
        r#"Normalize(image: "grey", from: Percentile(1, 99))"#,
        r#"Normalize(image: "in", from: Percentile(lo: 0.5, hi: 100), g_max: 2)"#,
        r#"Normalize(image: "pair", from: MinMax)"#,
    ],
);

impl Node for Normalize {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        match self.from {
            Ends::Percentile { lo, hi } if ![lo, hi].iter().all(|p| (0.0..=100.0).contains(p)) => {
                Err(Mistake::in_field("from", format!("there are no percentiles {lo} and {hi}"))
                    .hint("percentiles lie between 0 and 100: `Percentile(1, 99)`"))
            }
            _ => Ok(()),
        }
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let [low, high] = match self.from {
            Ends::Given => [cx.driven(&self.low), cx.driven(&self.high)],
            Ends::MinMax => {
                let extent = reduction::extent(cx, "extent", image, View::Luminance);
                [Value::Driven(extent.min), Value::Driven(extent.max)]
            }
            Ends::Percentile { lo, hi } => {
                let fractions = [lo, hi].map(|p| f64::from(p) / 100.0);
                let found = quantiles(cx, "percentile", image, View::Luminance, &fractions);
                [Value::Driven(found[0]), Value::Driven(found[1])]
            }
        };
        cx.pass("", shader!("analysis/normalize"))
            .entry(Entry::Point)
            .read("image", image, Reach::Point)
            .write("out", out)
            .param("low", low)
            .param("high", high)
            .param("g_max", self.g_max)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let luminances = || finite_values(&view(image, View::Luminance), 0);
        let (low, high) = match self.from {
            Ends::Given => (cx.driven(&self.low), cx.driven(&self.high)),
            Ends::MinMax => {
                let y = luminances();
                let end = |f: fn(f64, f64) -> f64| y.iter().copied().reduce(f).unwrap_or(0.0);
                (end(f64::min), end(f64::max))
            }
            Ends::Percentile { lo, hi } => {
                let y = luminances();
                let at = |p: f32| quantile_reference(&y, f64::from(p) / 100.0);
                (at(lo), at(hi))
            }
        };
        let g_max = f64::from(self.g_max);
        let stretch = |g: f64| if high == low { 0.0 } else { g_max * (g - low) / (high - low) };
        vec![Tensor::Image(image.map(image.channels, |[r, g, b, a]| [stretch(r), stretch(g), stretch(b), a]))]
    }
}
