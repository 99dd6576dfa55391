//! `SatAverage`: the mean of an image, read off its summed-area table.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::reduction::{self, Mean, View, finite_values, view};
use super::summed_area::{Term, Way, table};
use crate::shader;

/// The mean of every channel, alpha included, from the last pixel of the summed-area table: the value that
/// `PyramidAverage` gives, by another way. Values that are NaN or infinite take no part.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct SatAverage {
    /// The image to average.
    image: In<Image>,
    /// `Arithmetic`: Σv/n. `Geometric`: exp(Σ log(ε + max(v, 0))/n), the log-average luminance of tone mapping.
    mean: Mean,
    /// ε of the geometric mean: keeps the logarithm of black finite.
    #[default(1e-6)]
    #[schemars(range(min = 1e-30, max = 1e30))]
    epsilon: f32,
}

pub(crate) const KIND: Kind = Kind::of::<SatAverage>(
    "SatAverage",
    Category::Analysis,
    &[
        r#"SatAverage(image: "in")"#,
        r#"SatAverage(image: "grey", mean: Geometric)"#,
        r#"SatAverage(image: "in", mean: Geometric, epsilon: 0.01)"#,
        r#"SatAverage(image: "pair")"#,
    ],
)
.ports(&[("out", "the mean of every channel, a Scalar")]);

impl Node for SatAverage {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let components = inputs.image(&self.image).channels;
        Ok(Output::out(EdgeType::Scalar(ScalarType { components })))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let geometric = self.mean == Mean::Geometric;
        let term = if geometric { Term::Log { epsilon: self.epsilon } } else { Term::Value };
        let sums = table(cx, "sat", image, Way::Scan, term);
        let count = reduction::finite(cx, "count", image);
        cx.pass("", shader!("analysis/sat_average"))
            .entry(Entry::Kernel)
            .read("sums", sums, Reach::Whole)
            .read("count", count, Reach::Whole)
            .write("out", out)
            .constant("GEOMETRIC", geometric)
            .grid(Grid::Groups([1, 1, 1]))
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let pixels = view(image, View::Channels);
        let mean = |c: usize| reduction::mean_reference(&finite_values(&pixels, c), self.mean, f64::from(self.epsilon));
        vec![Tensor::Scalar((0..usize::from(image.channels)).map(mean).collect())]
    }
}
