//! `Gamma`: a power.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_rgb, point, same, untouched};
use crate::shader;

/// Raises colour to 1/gamma; negative values keep their sign. Alpha is kept.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Gamma {
    /// The image.
    image: In<Image>,
    /// Exponent 1/gamma.
    #[default = 1.0]
    #[schemars(range(min = 0.01, max = 100.0))]
    gamma: f32,
}

pub(super) const KIND: Kind =
    Kind::of::<Gamma>("Gamma", Category::Colour, &[r#"Gamma(image: "in", gamma: 2.2)"#, r#"Gamma(image: "grey", gamma: 0.5)"#])
        .tolerance(1e-6, 2e-5);

impl Node for Gamma {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        if untouched(cx, &self.image, matches!(self.gamma, 1.0)) {
            return Ok(());
        }
        point(cx, &self.image, shader!("colour/gamma")).param("power", 1.0 / self.gamma).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        map_rgb(cx, &self.image, |c| c.map(|v| if v == 0.0 { 0.0 } else { v.signum() * v.abs().powf(1.0 / f64::from(self.gamma)) }))
    }
}
