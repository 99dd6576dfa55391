//! `Quantize`: few levels, rounded up, down or to the nearest.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// Reduces colour, clamped to 0..1, to `levels` values: Up: max(1, ceil(v·L))/L; Nearest: round(v·(L−1))/(L−1);
/// Down: min(L−1, floor(v·L))/(L−1). Alpha is kept.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Quantize {
    /// The image.
    image: In<Image>,
    /// How many levels L, 2 or more.
    #[default = 8]
    #[schemars(range(min = 2, max = 65536))]
    levels: u32,
    /// Which of the formulas.
    rounding: Rounding,
}

pub(super) const KIND: Kind = Kind::of::<Quantize>(
    "Quantize",
    Category::Colour,
    &[
        r#"Quantize(image: "in")"#,
        r#"Quantize(image: "in", levels: 5, rounding: Up)"#,
        r#"Quantize(image: "grey", levels: 16, rounding: Down)"#,
    ],
);

/// How a value between two levels is rounded.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
enum Rounding {
    /// max(1, ceil(v·L))/L
    Up,
    /// round(v·(L−1))/(L−1)
    #[default]
    Nearest,
    /// min(L−1, floor(v·L))/(L−1)
    Down,
}

impl Node for Quantize {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/quantize"))
            .param("levels", self.levels as f32)
            .constant("ROUNDING", self.rounding as i32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let l = self.levels as f32;
        map_rgb(cx, &self.image, |c| {
            // Products are rounded to 32 bits, so that a value on an edge falls to the same side.
            c.map(|v| {
                let v = v.clamp(0.0, 1.0) as f32;
                let l64 = f64::from(l);
                match self.rounding {
                    Rounding::Up => f64::from((v * l).ceil()).max(1.0) / l64,
                    Rounding::Nearest => f64::from((v * (l - 1.0) + 0.5).floor()) / (l64 - 1.0),
                    Rounding::Down => f64::from((v * l).floor()).min(l64 - 1.0) / (l64 - 1.0),
                }
            })
        })
    }
}
