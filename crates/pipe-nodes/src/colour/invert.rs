//! `Invert`: the negative.

use pipe_graph::prelude::*;

use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// The negative: 1 − c. Alpha is kept.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Invert {
    /// The image.
    image: In<Image>,
}

pub(super) const KIND: Kind = Kind::of::<Invert>("Invert", Category::Colour, &[r#"Invert(image: "in")"#, r#"Invert(image: "grey")"#]);

impl Node for Invert {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/invert")).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        map_rgb(cx, &self.image, |c| c.map(|v| 1.0 - v))
    }
}
