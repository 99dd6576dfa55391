//! `Grade`: lift, gain, gamma and the rest, as in Nuke.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// Grades colour as Nuke's Grade does with its black point at 0 and its white point at 1:
/// A = multiply·(gain − lift), B = offset + lift, out = (A·in + B)^(1/gamma). Alpha is kept.
///
/// Negative values are raised to the power by magnitude and keep their sign.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Grade {
    /// The image.
    image: In<Image>,
    /// Where black goes.
    #[default([0.0, 0.0, 0.0])]
    lift: [f32; 3],
    /// Where white goes.
    #[default([1.0, 1.0, 1.0])]
    gain: [f32; 3],
    /// Exponent 1/gamma, applied last.
    #[default([1.0, 1.0, 1.0])]
    #[schemars(range(min = 0.01, max = 100.0))]
    gamma: [f32; 3],
    /// Added.
    #[default([0.0, 0.0, 0.0])]
    offset: [f32; 3],
    /// Factor.
    #[default([1.0, 1.0, 1.0])]
    multiply: [f32; 3],
}

pub(super) const KIND: Kind = Kind::of::<Grade>(
    "Grade",
    Category::Colour,
    &[
        r#"Grade(image: "in", gain: (1.2, 1.0, 0.9), gamma: (1.1, 1.0, 0.9))"#,
        r#"Grade(image: "in", lift: (0.05, 0.0, -0.02), offset: (0.01, 0.02, 0.03), multiply: (0.9, 1.1, 1.0))"#,
        r#"Grade(image: "grey", gain: (2, 2, 2))"#,
    ],
)
.tolerance(1e-5, 2e-5);

impl Node for Grade {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/grade"))
            .param("lift", self.lift)
            .param("gain", self.gain)
            .param("gamma", self.gamma)
            .param("offset", self.offset)
            .param("multiply", self.multiply)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        map_rgb(cx, &self.image, |c| {
            std::array::from_fn(|i| {
                let of = |v: &[f32; 3]| f64::from(v[i]);
                let v = of(&self.multiply) * (of(&self.gain) - of(&self.lift)) * c[i] + of(&self.offset) + of(&self.lift);
                v.signum() * v.abs().powf(1.0 / of(&self.gamma))
            })
        })
    }
}
