//! `Luminance`: colour to grey.

use pipe_graph::prelude::*;

use crate::colour::point::point;
use crate::shader;

/// The luminance of linear colour, as a 1-channel image: the weighted sum of r, g and b.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Luminance {
    /// The image.
    image: In<Image>,
    /// `Rec709` (0.2126, 0.7152, 0.0722), `Rec2020` (0.2627, 0.6780, 0.0593), or three weights.
    weights: Weights,
}

/// Weights of the channels.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
enum Weights {
    /// Weights of given primaries.
    #[default]
    #[serde(skip)]
    Default,
    /// By name.
    Named(Primaries),
    /// r, g, b.
    Given([f32; 3]),
}

/// Primaries with a luminance.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
enum Primaries {
    /// ITU-R BT.709-6.
    Rec709,
    /// ITU-R BT.2020-2.
    Rec2020,
}

pub(super) const KIND: Kind = Kind::of::<Luminance>(
    "Luminance",
    Category::Colour,
    &[
        r#"Luminance(image: "in")"#,
        r#"Luminance(image: "in", weights: Rec2020)"#,
        r#"Luminance(image: "in", weights: [0.3, 0.6, 0.1])"#,
        r#"Luminance(image: "grey")"#,
    ],
);

impl Luminance {
    const fn weights(&self) -> [f32; 3] {
        match self.weights {
            Weights::Default | Weights::Named(Primaries::Rec709) => [0.2126, 0.7152, 0.0722],
            Weights::Named(Primaries::Rec2020) => [0.2627, 0.6780, 0.0593],
            Weights::Given(w) => w,
        }
    }
}

impl Node for Luminance {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image).with_channels(1))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/luminance")).param("weights", self.weights()).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let w = self.weights().map(f64::from);
        vec![Tensor::Image(cx.image(&self.image).map(1, |[r, g, b, _]| [w[0] * r + w[1] * g + w[2] * b; 4]))]
    }
}
