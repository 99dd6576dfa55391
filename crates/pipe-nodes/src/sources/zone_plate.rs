//! `ZonePlate`: every frequency at once.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::components::Size;
use crate::shader;
use crate::sources::canvas::{SIZE, image, paint};

/// 0.5 + 0.5·cos(π·r²/size), r the distance in pixels from the centre: the frequency grows with r and reaches half a cycle a
/// pixel at the edge of the larger side. One channel.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct ZonePlate {
    /// Width and height; one number for a square.
    #[default(SIZE)]
    #[schemars(extend("x-unit" = "px"))]
    size: Size,
}

pub(super) const KIND: Kind =
    Kind::of::<ZonePlate>("ZonePlate", Category::Sources, &[r#"ZonePlate(size: (128, 96))"#, r#"ZonePlate(size: (61, 47))"#])
        .tolerance(1e-4, 0.0);

impl Node for ZonePlate {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        image(self.size, 1)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        paint(cx, shader!("sources/zone_plate")).add();
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        let n = f64::from(self.size.0[0].max(self.size.0[1]));
        let centre = self.size.0.map(|n| f64::from(n) / 2.0);
        vec![Tensor::Image(Raster::from_fn(self.size.0, 1, |x, y| {
            let (dx, dy) = (x as f64 + 0.5 - centre[0], y as f64 + 0.5 - centre[1]);
            [0.5 + 0.5 * (std::f64::consts::PI * (dx * dx + dy * dy) / n).cos(); 4]
        }))]
    }
}
