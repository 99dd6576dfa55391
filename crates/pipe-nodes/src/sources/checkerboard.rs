//! `Checkerboard`: squares of two colours.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::components::{Rgba, Size};
use crate::shader;
use crate::sources::canvas::{SIZE, image, paint};

/// Squares of two colours; the square at the top left is `a`.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Checkerboard {
    /// The first colour.
    #[default(Rgba([0.2, 0.2, 0.2, 1.0]))]
    a: Rgba,
    /// The second colour.
    #[default(Rgba([0.8, 0.8, 0.8, 1.0]))]
    b: Rgba,
    /// Side of a square.
    #[default = 32]
    #[schemars(range(min = 1, max = 65536), extend("x-unit" = "px"))]
    cell: u32,
    /// Width and height; one number for a square.
    #[default(SIZE)]
    #[schemars(extend("x-unit" = "px"))]
    size: Size,
}

pub(super) const KIND: Kind = Kind::of::<Checkerboard>(
    "Checkerboard",
    Category::Sources,
    &[r#"Checkerboard(size: (64, 48), cell: 8)"#, r#"Checkerboard(size: (65, 31), cell: 7, a: (1, 0, 0, 1), b: (0, 0, 1, 0))"#],
)
.tolerance(0.0, 0.0);

impl Node for Checkerboard {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        image(self.size, 4)
    }

    fn makes_alpha(&self) -> bool {
        [self.a, self.b].iter().any(|color| color.0[3] != 1.0)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        paint(cx, shader!("sources/checkerboard")).param("a", self.a.0).param("b", self.b.0).param("cell", self.cell as i32).add();
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        let cell = i64::from(self.cell);
        vec![Tensor::Image(Raster::from_fn(self.size.0, 4, |x, y| {
            if (x / cell + y / cell) % 2 == 0 { self.a.0.map(f64::from) } else { self.b.0.map(f64::from) }
        }))]
    }
}
