//! `Saturation`: away from or towards grey.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// Moves colour away from (or towards) its luminance: Y + factor·(c − Y). Alpha is kept.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Saturation {
    /// The image.
    image: In<Image>,
    /// 0 is grey, 1 leaves colour as it is.
    #[default = 1.0]
    factor: f32,
}

pub(super) const KIND: Kind = Kind::of::<Saturation>(
    "Saturation",
    Category::Colour,
    &[r#"Saturation(image: "in", factor: 0.3)"#, r#"Saturation(image: "in", factor: 1.8)"#, r#"Saturation(image: "grey", factor: 0)"#],
);

impl Node for Saturation {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/saturation")).param("factor", self.factor).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        map_rgb(cx, &self.image, |c| {
            let y = luminance([c[0], c[1], c[2], 1.0]);
            c.map(|v| y + f64::from(self.factor) * (v - y))
        })
    }
}
