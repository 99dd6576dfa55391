//! `Grade`: lift, gain, gamma and the rest, as in Nuke.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_tinted, point, tinted, untouched};
use crate::components::Rgb;
use crate::shader;

/// Grades colour as Nuke's Grade does with its black point at 0 and its white point at 1:
/// A = multiply·(gain − lift), B = offset + lift, out = (A·in + B)^(1/gamma). Alpha is kept.
///
/// The power leaves values below 0 as they are. A 1-channel image becomes colour where channels are graded differently.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Grade {
    /// The image.
    image: In<Image>,
    /// What black becomes: a number, or (r, g, b).
    #[default(Rgb::grey(0.0))]
    lift: Rgb,
    /// What white becomes.
    #[default(Rgb::grey(1.0))]
    gain: Rgb,
    /// Exponent 1/gamma, applied last.
    #[default(Rgb::grey(1.0))]
    #[schemars(extend("minimum" = 0.01, "maximum" = 100.0))]
    gamma: Rgb,
    /// Added after gain and lift.
    #[default(Rgb::grey(0.0))]
    offset: Rgb,
    /// Factor of gain and lift.
    #[default(Rgb::grey(1.0))]
    multiply: Rgb,
}

pub(super) const KIND: Kind = Kind::of::<Grade>(
    "Grade",
    Category::Colour,
    &[
        r#"Grade(image: "in", gain: (1.2, 1.0, 0.9), gamma: (1.1, 1.0, 0.9))"#,
        r#"Grade(image: "in", lift: (0.05, 0.0, -0.02), offset: (0.01, 0.02, 0.03), multiply: (0.9, 1.1, 1.0))"#,
        r#"Grade(image: "grey", gain: 2, gamma: 0.8, offset: -0.3)"#,
        r#"Grade(image: "grey", multiply: (1, 0.8, 0.5))"#,
    ],
)
.tolerance(2e-6, 2e-5);

impl Grade {
    fn tints(&self) -> bool {
        ![self.lift, self.gain, self.gamma, self.offset, self.multiply].iter().all(Rgb::is_grey)
    }
}

impl Grade {
    /// Whether every value stays as it is.
    fn is_neutral(&self) -> bool {
        let [zero, one] = [0.0, 1.0].map(Rgb::grey);
        [self.lift, self.offset] == [zero; 2] && [self.gain, self.gamma, self.multiply] == [one; 3]
    }
}

impl Node for Grade {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        tinted(inputs, &self.image, self.tints())
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        if untouched(cx, &self.image, self.is_neutral()) {
            return Ok(());
        }
        point(cx, &self.image, shader!("colour/grade"))
            .param("lift", self.lift.0)
            .param("gain", self.gain.0)
            .param("power", self.gamma.0.map(f32::recip))
            .param("offset", self.offset.0)
            .param("multiply", self.multiply.0)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        map_tinted(cx, &self.image, self.tints(), |c| {
            std::array::from_fn(|i| {
                let a = self.multiply.at(i) * (self.gain.at(i) - self.lift.at(i));
                let v = a * c[i] + self.offset.at(i) + self.lift.at(i);
                if v > 0.0 { v.powf(1.0 / self.gamma.at(i)) } else { v }
            })
        })
    }
}
