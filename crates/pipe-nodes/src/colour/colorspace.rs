//! `Colorspace`: primaries, white point and transfer function.

use glam::{DMat3, DVec3};
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_tinted, point, tinted, untouched};
use crate::colour::primaries::{ACES_AP0, ACES_AP1, Chromaticities, P3, REC709, REC2020, rows, to_xyz};
use crate::shader;

/// Converts colour between colour spaces: transfer function, primaries and white point (Bradford). Alpha is kept.
///
/// Spaces: `srgb` and `rec709` (the same primaries), `rec2020`, `p3` (D65), `acescg`, `aces2065-1`, `xyz` (D65, Y = 1 for
/// white). `srgb` and `p3` are encoded with the sRGB curve, `rec709` and `rec2020` with that of ITU-R BT.709; put
/// `linear-` before the name (`linear-srgb`) for linear values; the others are always linear. Curves are odd about 0, so
/// that negative values survive. The working space is `linear-srgb`, or just `linear`. A 1-channel image becomes colour from and to `xyz`.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Colorspace {
    /// The image.
    image: In<Image>,
    /// The space that it is in.
    #[default("linear-srgb".to_owned())]
    from: String,
    /// The space that it shall be in.
    #[default("linear-srgb".to_owned())]
    to: String,
}

pub(super) const KIND: Kind = Kind::of::<Colorspace>(
    "Colorspace",
    Category::Colour,
    &[
        r#"Colorspace(image: "in", from: "linear-srgb", to: "acescg")"#,
        r#"Colorspace(image: "in", from: "linear-srgb", to: "srgb")"#,
        r#"Colorspace(image: "in", from: "rec2020", to: "linear-p3")"#,
        r#"Colorspace(image: "in", from: "aces2065-1", to: "xyz")"#,
        r#"Colorspace(image: "in", from: "xyz", to: "rec709")"#,
        r#"Colorspace(image: "in", from: "p3", to: "rec2020-linear")"#,
        r#"Colorspace(image: "grey", from: "srgb", to: "rec709")"#,
        r#"Colorspace(image: "grey", to: "xyz")"#,
    ],
)
.tolerance(2e-6, 2e-5);

/// A transfer function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Transfer {
    Linear = 0,
    Srgb = 1,
    Bt709 = 2,
}

/// A colour space.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Space {
    /// None is XYZ.
    primaries: Option<Chromaticities>,
    transfer: Transfer,
}

impl Space {
    fn named(name: &str) -> Option<Self> {
        let bare = name.strip_prefix("linear-").or_else(|| name.strip_suffix("-linear"));
        let (primaries, encoded) = match bare.unwrap_or(name) {
            "srgb" => (Some(REC709), Transfer::Srgb),
            "rec709" => (Some(REC709), Transfer::Bt709),
            "rec2020" => (Some(REC2020), Transfer::Bt709),
            "p3" => (Some(P3), Transfer::Srgb),
            "acescg" => (Some(ACES_AP1), Transfer::Linear),
            "aces2065-1" => (Some(ACES_AP0), Transfer::Linear),
            "xyz" => (None, Transfer::Linear),
            "linear" => (Some(REC709), Transfer::Linear),
            _ => return None,
        };
        Some(Self { primaries, transfer: if bare.is_some() { Transfer::Linear } else { encoded } })
    }

    fn to_xyz(self) -> DMat3 {
        self.primaries.map_or(DMat3::IDENTITY, to_xyz)
    }
}

impl Transfer {
    /// Encoded to linear.
    fn decode(self, v: f64) -> f64 {
        let a = v.abs();
        let linear = match self {
            Self::Linear => return v,
            Self::Srgb if a <= 0.04045 => a / 12.92,
            Self::Srgb => ((a + 0.055) / 1.055).powf(2.4),
            Self::Bt709 if a < 0.081 => a / 4.5,
            Self::Bt709 => ((a + 0.099) / 1.099).powf(1.0 / 0.45),
        };
        linear.copysign(v)
    }

    /// Linear to encoded: IEC 61966-2-1, ITU-R BT.709-6 item 1.2.
    fn encode(self, v: f64) -> f64 {
        let a = v.abs();
        let encoded = match self {
            Self::Linear => return v,
            Self::Srgb if a <= 0.003_130_8 => a * 12.92,
            Self::Srgb => 1.055 * a.powf(1.0 / 2.4) - 0.055,
            Self::Bt709 if a < 0.018 => a * 4.5,
            Self::Bt709 => 1.099 * a.powf(0.45) - 0.099,
        };
        encoded.copysign(v)
    }
}

impl Colorspace {
    fn spaces(&self) -> Result<(Space, Space), Mistake> {
        let find = |field: &str, name: &str| {
            Space::named(name).ok_or_else(|| {
                Mistake::in_field(field, format!("names no colour space: \"{name}\""))
                    .hint("expected srgb, rec709, rec2020, p3, acescg, aces2065-1 or xyz, with `linear-` before it for linear values")
            })
        };
        Ok((find("from", &self.from)?, find("to", &self.to)?))
    }

    /// Red, green and blue of grey differ in XYZ only.
    fn tints(&self) -> bool {
        self.spaces().is_ok_and(|(from, to)| from.primaries.is_none() != to.primaries.is_none())
    }
}

impl Node for Colorspace {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        self.spaces().map(drop)
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        tinted(inputs, &self.image, self.tints())
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (from, to) = self.spaces()?;
        if untouched(cx, &self.image, from == to) {
            return Ok(());
        }
        let [row0, row1, row2] = rows(&(to.to_xyz().inverse() * from.to_xyz()));
        point(cx, &self.image, shader!("colour/colorspace"))
            .constant("DECODE", from.transfer as i32)
            .constant("MIXES", from.primaries != to.primaries)
            .constant("ENCODE", to.transfer as i32)
            .param("row0", row0)
            .param("row1", row1)
            .param("row2", row2)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (from, to) = self.spaces().expect("`open` has checked the names");
        let m = to.to_xyz().inverse() * from.to_xyz();
        map_tinted(cx, &self.image, self.tints(), |c| {
            let linear = c.map(|v| from.transfer.decode(v));
            (m * DVec3::from_array(linear)).to_array().map(|v| to.transfer.encode(v))
        })
    }
}
