//! `Impulse`: one bright pixel.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::components::Size;
use crate::shader;
use crate::sources::canvas::{SIZE, image, paint};

/// One pixel of a value on black; one channel. At the centre (width/2, height/2, rounded down) unless said.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Impulse {
    /// The pixel, (x, y); the centre when absent.
    position: Option<[u32; 2]>,
    /// Its value.
    #[default = 1.0]
    value: f32,
    /// Width and height; one number for a square.
    #[default(SIZE)]
    #[schemars(extend("x-unit" = "px"))]
    size: Size,
}

pub(super) const KIND: Kind = Kind::of::<Impulse>(
    "Impulse",
    Category::Sources,
    &[r#"Impulse(size: (33, 21))"#, r#"Impulse(size: (8, 8), position: (1, 6), value: 3)"#],
)
.tolerance(0.0, 0.0);

impl Impulse {
    fn at(&self) -> [u32; 2] {
        self.position.unwrap_or(self.size.0.map(|n| n / 2))
    }
}

impl Node for Impulse {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        image(self.size, 1)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        paint(cx, shader!("sources/impulse")).param("at", self.at().map(|v| v as i32)).param("value", self.value).add();
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        let [x0, y0] = self.at().map(i64::from);
        vec![Tensor::Image(Raster::from_fn(self.size.0, 1, |x, y| if (x, y) == (x0, y0) { [f64::from(self.value); 4] } else { [0.0; 4] }))]
    }
}
