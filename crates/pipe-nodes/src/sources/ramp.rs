//! `Ramp`: from one colour to another.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::components::{Rgba, Size};
use crate::shader;
use crate::sources::canvas::{SIZE, image, paint};

/// A linear ramp between two colours, from pixel centre to pixel centre: the first pixel is `from`, the last is `to`.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Ramp {
    /// The colour of the first pixel.
    #[default(Rgba([0.0, 0.0, 0.0, 1.0]))]
    from: Rgba,
    /// The colour of the last pixel.
    #[default(Rgba([1.0, 1.0, 1.0, 1.0]))]
    to: Rgba,
    /// Along which axis.
    direction: Direction,
    /// Width and height; one number for a square.
    #[default(SIZE)]
    #[schemars(extend("x-unit" = "px"))]
    size: Size,
}

pub(super) const KIND: Kind = Kind::of::<Ramp>(
    "Ramp",
    Category::Sources,
    &[r#"Ramp(size: (64, 48))"#, r#"Ramp(from: (1, 0, 0, 1), to: (0, 2, 1, 0.5), direction: Vertical, size: (7, 33))"#],
);

/// An axis.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
enum Direction {
    /// From left to right.
    #[default]
    Horizontal,
    /// From top to bottom.
    Vertical,
}

impl Node for Ramp {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        image(self.size, 4)
    }

    fn makes_alpha(&self) -> bool {
        [self.from, self.to].iter().any(|color| color.0[3] != 1.0)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        paint(cx, shader!("sources/ramp"))
            .param("first", self.from.0)
            .param("last", self.to.0)
            .constant("ALONG_X", matches!(self.direction, Direction::Horizontal))
            .add();
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        let [w, h] = self.size.0;
        vec![Tensor::Image(Raster::from_fn(self.size.0, 4, |x, y| {
            let (at, n) = if matches!(self.direction, Direction::Horizontal) { (x, w) } else { (y, h) };
            let t = at as f64 / f64::from((n - 1).max(1));
            std::array::from_fn(|c| f64::from(self.from.0[c]) * (1.0 - t) + f64::from(self.to.0[c]) * t)
        }))]
    }
}
