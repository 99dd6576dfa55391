//! `Cdl`: the colour decision list of the ASC.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// The ASC colour decision list: out = clamp(in·slope + offset)^power, then saturation about Rec.709 luminance.
///
/// Values below 0 are clamped before the power, as ASC CDL 1.2 says; values above 1 are kept. Alpha is kept.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Cdl {
    /// The image.
    image: In<Image>,
    /// Factor.
    #[default([1.0, 1.0, 1.0])]
    #[schemars(range(min = 0.0))]
    slope: [f32; 3],
    /// Added.
    #[default([0.0, 0.0, 0.0])]
    offset: [f32; 3],
    /// Exponent.
    #[default([1.0, 1.0, 1.0])]
    #[schemars(range(min = 0.01, max = 100.0))]
    power: [f32; 3],
    /// 0 is grey, 1 leaves colour as it is.
    #[default = 1.0]
    #[schemars(range(min = 0.0))]
    saturation: f32,
}

pub(super) const KIND: Kind = Kind::of::<Cdl>(
    "Cdl",
    Category::Colour,
    &[
        r#"Cdl(image: "in", slope: (1.1, 1.0, 0.9), offset: (0.01, 0.0, -0.01), power: (1.2, 1.0, 0.8), saturation: 0.8)"#,
        r#"Cdl(image: "in")"#,
    ],
)
.tolerance(1e-5, 2e-5);

impl Node for Cdl {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/cdl"))
            .param("slope", self.slope)
            .param("offset", self.offset)
            .param("power", self.power)
            .param("saturation", self.saturation)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        map_rgb(cx, &self.image, |c| {
            let p: [f64; 3] = std::array::from_fn(|i| {
                (c[i] * f64::from(self.slope[i]) + f64::from(self.offset[i])).max(0.0).powf(f64::from(self.power[i]))
            });
            let y = luminance([p[0], p[1], p[2], 1.0]);
            p.map(|v| y + f64::from(self.saturation) * (v - y))
        })
    }
}
