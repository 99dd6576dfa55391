//! `BlurH` and `BlurV`: convolution along one axis, with a Gaussian or with given weights.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::gaussian::{Axis, convolve, convolve_reference, radius, weights};

/// Convolves along rows with a Gaussian, or with given weights.
///
/// The weights are exp(−k²/2σ²), k = −R..R, normalised to sum 1.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct BlurH {
    /// The image.
    image: In<Image>,
    /// Standard deviation of the Gaussian; 0 copies.
    #[default = 2.0]
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "px"))]
    sigma: f32,
    /// Taps to either side; ceil(3σ) when absent.
    #[schemars(range(min = 0, max = 3000), extend("x-unit" = "px"))]
    radius: Option<u32>,
    /// Weights that replace the Gaussian, an odd number of them, used as given: not normalised.
    weights: Vec<f32>,
}

/// Convolves along columns with a Gaussian, or with given weights.
///
/// The weights are exp(−k²/2σ²), k = −R..R, normalised to sum 1.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct BlurV {
    /// The image.
    image: In<Image>,
    /// Standard deviation of the Gaussian; 0 copies.
    #[default = 2.0]
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "px"))]
    sigma: f32,
    /// Taps to either side; ceil(3σ) when absent.
    #[schemars(range(min = 0, max = 3000), extend("x-unit" = "px"))]
    radius: Option<u32>,
    /// Weights that replace the Gaussian, an odd number of them, used as given: not normalised.
    weights: Vec<f32>,
}

pub(super) const BLUR_H: Kind = Kind::of::<BlurH>(
    "BlurH",
    Category::Filters,
    &[
        r#"BlurH(image: "in")"#,
        r#"BlurH(image: "in", weights: [0.25, 0.5, 0.25])"#,
        r#"BlurH(image: "grey", sigma: 1.3, radius: 7)"#,
        r#"BlurH(image: "pair", weights: [0.1, 0.2, 0.3, 0.25, 0.05])"#,
        r#"BlurH(image: "in", sigma: 0)"#,
    ],
);

pub(super) const BLUR_V: Kind = Kind::of::<BlurV>(
    "BlurV",
    Category::Filters,
    &[
        r#"BlurV(image: "in")"#,
        r#"BlurV(image: "in", weights: [0.25, 0.5, 0.25])"#,
        r#"BlurV(image: "grey", sigma: 5)"#,
        r#"BlurV(image: "pair", weights: [0.1, 0.2, 0.3, 0.25, 0.05])"#,
    ],
);

/// The weights in use.
fn chosen(sigma: f32, given_radius: Option<u32>, given: &[f32]) -> Vec<f64> {
    if given.is_empty() {
        weights(sigma, given_radius.unwrap_or_else(|| radius(sigma)))
    } else {
        given.iter().map(|w| f64::from(*w)).collect()
    }
}

fn check(given: &[f32]) -> Result<(), Mistake> {
    if !given.is_empty() && given.len().is_multiple_of(2) {
        return Err(Mistake::in_field("weights", format!("has {} entries", given.len()))
            .hint("expected an odd number, the middle one for the pixel itself"));
    }
    if given.len() > 6001 {
        return Err(Mistake::in_field("weights", format!("has {} entries", given.len())).hint("expected at most 6001"));
    }
    Ok(())
}

macro_rules! node {
    ($node:ident, $axis:expr) => {
        impl Node for $node {
            fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
                check(&self.weights)
            }

            fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
                Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
            }

            fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
                let image = cx.input(&self.image);
                let weights = chosen(self.sigma, self.radius, &self.weights);
                if weights == [1.0] && cx.pass_on("out", image) {
                    return Ok(());
                }
                let out = cx.output("out");
                convolve(cx, "", $axis, &weights, image, out);
                Ok(())
            }

            fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
                let weights = chosen(self.sigma, self.radius, &self.weights);
                vec![Tensor::Image(convolve_reference(cx.image(&self.image), $axis, &weights, cx.border))]
            }
        }
    };
}

node!(BlurH, Axis::X);
node!(BlurV, Axis::Y);
