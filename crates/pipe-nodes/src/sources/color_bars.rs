//! `ColorBars`: eight bars.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::components::Size;
use crate::shader;
use crate::sources::canvas::{SIZE, image, paint};

/// Eight vertical bars at 75 %: white, yellow, cyan, green, magenta, red, blue, black; linear values.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct ColorBars {
    /// Width and height; one number for a square.
    #[default(SIZE)]
    #[schemars(extend("x-unit" = "px"))]
    size: Size,
}

pub(super) const KIND: Kind =
    Kind::of::<ColorBars>("ColorBars", Category::Sources, &[r#"ColorBars(size: (64, 8))"#, r#"ColorBars(size: (61, 3))"#])
        .tolerance(0.0, 0.0);

impl Node for ColorBars {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        image(self.size, 4)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        paint(cx, shader!("sources/color_bars")).add();
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        let bars = [[1, 1, 1], [1, 1, 0], [0, 1, 1], [0, 1, 0], [1, 0, 1], [1, 0, 0], [0, 0, 1], [0, 0, 0]];
        let w = i64::from(self.size.0[0]);
        vec![Tensor::Image(Raster::from_fn(self.size.0, 4, |x, _| {
            let [r, g, b] = bars[(x * 8 / w).min(7) as usize].map(|v| 0.75 * f64::from(v));
            [r, g, b, 1.0]
        }))]
    }
}
