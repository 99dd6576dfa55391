//! `Constant`: one colour everywhere.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::components::{Rgba, Size};
use crate::shader;
use crate::sources::canvas::{SIZE, image, paint};

/// One colour everywhere.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Constant {
    /// Red, green, blue and alpha, linear, alpha associated; alpha is 1 where it is left out, one number is a grey.
    #[default(Rgba([0.5, 0.5, 0.5, 1.0]))]
    color: Rgba,
    /// Width and height; one number for a square.
    #[default(SIZE)]
    #[schemars(extend("x-unit" = "px"))]
    size: Size,
}

pub(super) const KIND: Kind = Kind::of::<Constant>(
    "Constant",
    Category::Sources,
    &[r#"Constant(color: (1.0, 0.5, 0.25, 1.0), size: (64, 48))"#, r#"Constant(color: 0.18, size: 48)"#],
)
.tolerance(0.0, 0.0);

impl Node for Constant {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        image(self.size, 4)
    }

    fn makes_alpha(&self) -> bool {
        self.color.0[3] != 1.0
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        paint(cx, shader!("sources/constant")).param("color", self.color.0).add();
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        vec![Tensor::Image(Raster::from_fn(self.size.0, 4, |_, _| self.color.0.map(f64::from)))]
    }
}
