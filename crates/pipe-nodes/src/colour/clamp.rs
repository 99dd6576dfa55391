//! `Clamp`: bounds for every channel of colour.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// Bounds colour: max(min, min(max, c)). Alpha is kept, NaN stays NaN.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Clamp {
    /// The image.
    image: In<Image>,
    /// Lower bound.
    min: Driven,
    /// Upper bound.
    #[default(Driven::Value(1.0))]
    max: Driven,
}

pub(super) const KIND: Kind = Kind::of::<Clamp>(
    "Clamp",
    Category::Colour,
    &[r#"Clamp(image: "in")"#, r#"Clamp(image: "in", min: -0.1, max: "scalar")"#, r#"Clamp(image: "grey", min: 0.2, max: 0.4)"#],
);

impl Node for Clamp {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/clamp")).driven("low", &self.min).driven("high", &self.max).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (low, high) = (cx.driven(&self.min), cx.driven(&self.max));
        map_rgb(cx, &self.image, |c| c.map(|v| if v.is_nan() { v } else { v.min(high).max(low) }))
    }
}
