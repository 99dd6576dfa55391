//! `Posterize`: few levels.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// Reduces each channel of colour to a number of levels in 0..1: round(c·(levels − 1))/(levels − 1), clamped to 0..1.
/// Alpha is kept.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Posterize {
    /// The image.
    image: In<Image>,
    /// How many levels, 2 or more.
    #[default = 8]
    #[schemars(range(min = 2, max = 65536))]
    levels: u32,
}

pub(super) const KIND: Kind = Kind::of::<Posterize>(
    "Posterize",
    Category::Colour,
    &[r#"Posterize(image: "in", levels: 4)"#, r#"Posterize(image: "grey", levels: 256)"#],
);

impl Node for Posterize {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/posterize")).param("steps", (self.levels - 1) as f32).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let steps = f64::from(self.levels - 1);
        map_rgb(cx, &self.image, |c| c.map(|v| (f64::from((v.clamp(0.0, 1.0) as f32) * steps as f32 + 0.5)).floor() / steps))
    }
}
