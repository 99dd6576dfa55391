//! `Levels`: black and white points in and out, with a gamma between.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// Maps in_low..in_high to out_low..out_high through a gamma: out_low + (out_high − out_low)·t^(1/gamma),
/// t = (in − in_low)/(in_high − in_low). Nothing is clamped; negative t keeps its sign. Alpha is kept.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Levels {
    /// The image.
    image: In<Image>,
    /// Input black.
    in_low: Driven,
    /// Input white.
    #[default(Driven::Value(1.0))]
    in_high: Driven,
    /// Exponent 1/gamma.
    #[default = 1.0]
    #[schemars(range(min = 0.01, max = 100.0))]
    gamma: f32,
    /// Output black.
    out_low: f32,
    /// Output white.
    #[default = 1.0]
    out_high: f32,
}

pub(super) const KIND: Kind = Kind::of::<Levels>(
    "Levels",
    Category::Colour,
    &[
        r#"Levels(image: "in", in_low: 0.1, in_high: 0.9, gamma: 1.2)"#,
        r#"Levels(image: "in", in_high: "scalar", out_low: 0.1, out_high: 0.8)"#,
        r#"Levels(image: "grey", in_low: 0.5, in_high: 0.5)"#,
    ],
)
.tolerance(1e-5, 2e-5);

impl Node for Levels {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/levels"))
            .driven("in_low", &self.in_low)
            .driven("in_high", &self.in_high)
            .param("power", 1.0 / self.gamma)
            .param("out_low", self.out_low)
            .param("out_high", self.out_high)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (low, high) = (cx.driven(&self.in_low), cx.driven(&self.in_high));
        let width = if high == low { 1.0 } else { high - low };
        let power = 1.0 / f64::from(self.gamma);
        let (a, b) = (f64::from(self.out_low), f64::from(self.out_high));
        map_rgb(cx, &self.image, |c| {
            c.map(|v| {
                let t = (v - low) / width;
                a + (b - a) * if t == 0.0 { 0.0 } else { t.signum() * t.abs().powf(power) }
            })
        })
    }
}
