//! `Premultiply`: colour times alpha.

use pipe_graph::prelude::*;

use crate::colour::point::{point, same};
use crate::shader;

/// Multiplies colour by alpha.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Premultiply {
    /// The image.
    image: In<Image>,
}

pub(super) const KIND: Kind = Kind::of::<Premultiply>("Premultiply", Category::Colour, &[r#"Premultiply(image: "in")"#]);

impl Node for Premultiply {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/premultiply")).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        vec![Tensor::Image(image.map(image.channels, |[r, g, b, a]| [r * a, g * a, b * a, a]))]
    }
}
