//! `Unpremultiply`: colour over alpha.

use pipe_graph::prelude::*;

use crate::colour::point::{point, same};
use crate::shader;

/// Divides colour by alpha; where alpha is 0 colour stays as it is.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Unpremultiply {
    /// The image.
    image: In<Image>,
}

pub(super) const KIND: Kind = Kind::of::<Unpremultiply>("Unpremultiply", Category::Colour, &[r#"Unpremultiply(image: "in")"#]);

impl Node for Unpremultiply {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/unpremultiply")).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        vec![Tensor::Image(image.map(image.channels, |[r, g, b, a]| {
            let d = if a == 0.0 { 1.0 } else { a };
            [r / d, g / d, b / d, a]
        }))]
    }
}
