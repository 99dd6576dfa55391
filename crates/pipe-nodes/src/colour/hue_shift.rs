//! `HueShift`: turns colour about grey.

use pipe_graph::prelude::*;

use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// Turns colour about the grey axis by an angle, keeping r + g + b: Rodrigues' rotation about (1, 1, 1)/√3.
/// Alpha is kept.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct HueShift {
    /// The image.
    image: In<Image>,
    /// Angle; 120 takes red to green.
    #[schemars(range(min = -3600.0, max = 3600.0), extend("x-unit" = "degrees"))]
    degrees: f32,
}

pub(super) const KIND: Kind = Kind::of::<HueShift>(
    "HueShift",
    Category::Colour,
    &[r#"HueShift(image: "in", degrees: 40)"#, r#"HueShift(image: "in", degrees: -120)"#],
);

impl Node for HueShift {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/hue_shift"))
            .param("cosine", (f64::from(self.degrees).to_radians().cos()) as f32)
            .param("sine", (f64::from(self.degrees).to_radians().sin()) as f32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (sine, cosine) = f64::from(self.degrees).to_radians().sin_cos();
        map_rgb(cx, &self.image, |[r, g, b]| {
            let third = (r + g + b) / 3.0 * (1.0 - cosine);
            let k = 1.0 / 3.0_f64.sqrt();
            [r * cosine + k * (b - g) * sine + third, g * cosine + k * (r - b) * sine + third, b * cosine + k * (g - r) * sine + third]
        })
    }
}
