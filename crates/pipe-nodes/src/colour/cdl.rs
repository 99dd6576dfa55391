//! `Cdl`: the colour decision list of the ASC.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_tinted, point, tinted};
use crate::components::Rgb;
use crate::shader;

/// The ASC colour decision list: out = max(in·slope + offset, 0)^power, then saturation about Rec.709 luminance.
///
/// Values below 0 are clamped before the power, as ASC CDL 1.2 says; values above 1 are kept, since images are
/// scene-referred. Alpha is kept. A 1-channel image becomes colour where channels are treated differently.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Cdl {
    /// The image.
    image: In<Image>,
    /// Factor: a number, or (r, g, b).
    #[default(Rgb::grey(1.0))]
    #[schemars(extend("minimum" = 0.0))]
    slope: Rgb,
    /// Added.
    #[default(Rgb::grey(0.0))]
    offset: Rgb,
    /// Exponent.
    #[default(Rgb::grey(1.0))]
    #[schemars(extend("minimum" = 0.01, "maximum" = 100.0))]
    power: Rgb,
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
        r#"Cdl(image: "grey", slope: (1.2, 1.0, 0.7), saturation: 1.5)"#,
        r#"Cdl(image: "grey", power: 0.5)"#,
    ],
)
.tolerance(2e-6, 2e-5);

impl Cdl {
    fn tints(&self) -> bool {
        ![self.slope, self.offset, self.power].iter().all(Rgb::is_grey)
    }
}

impl Node for Cdl {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        tinted(inputs, &self.image, self.tints())
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/cdl"))
            .param("slope", self.slope.0)
            .param("offset", self.offset.0)
            .param("power", self.power.0)
            .param("saturation", self.saturation)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        map_tinted(cx, &self.image, self.tints(), |c| {
            let p: [f64; 3] = std::array::from_fn(|i| {
                let v = c[i] * self.slope.at(i) + self.offset.at(i);
                if v.is_nan() { v } else { v.max(0.0).powf(self.power.at(i)) }
            });
            let y = luminance([p[0], p[1], p[2], 1.0]);
            p.map(|v| y + f64::from(self.saturation) * (v - y))
        })
    }
}
