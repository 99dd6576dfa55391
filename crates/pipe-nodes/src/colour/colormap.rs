//! `Colormap`: luminance as colour.

use pipe_graph::prelude::*;

use crate::colour::point::{map_tinted, point, tinted};
use crate::shader;

/// Shows luminance 0..1 by the colours of a map; what lies outside is clamped, NaN stays NaN. Alpha is kept.
///
/// 256 colours as in Matplotlib, decoded from sRGB to linear light: an 8-bit output holds the colours that every plot has.
/// Between them colour is interpolated. `grey` is even in display values too: 0.5 is 128 of 255, not half the light.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Colormap {
    /// The image; a 1-channel image is taken as it is.
    image: In<Image>,
    /// Which colours.
    map: Map,
}

/// Colour maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Map {
    /// From violet over green to yellow, even in lightness.
    #[default]
    Viridis,
    /// From black over red to pale yellow.
    Inferno,
    /// From black over purple to pale pink.
    Magma,
    /// A smooth rainbow.
    Turbo,
    /// From black to white.
    Grey,
}

pub(super) const KIND: Kind = Kind::of::<Colormap>(
    "Colormap",
    Category::Colour,
    &[
        r#"Colormap(image: "grey")"#,
        r#"Colormap(image: "in", map: inferno)"#,
        r#"Colormap(image: "in", map: magma)"#,
        r#"Colormap(image: "grey", map: turbo)"#,
        r#"Colormap(image: "in", map: grey)"#,
    ],
)
.tolerance(2e-5, 1e-5);

/// The data file, a name and 256 lines a map.
const MAPS: &str = include_str!("colormaps.txt");

impl Map {
    const fn name(self) -> &'static str {
        match self {
            Self::Viridis => "viridis",
            Self::Inferno => "inferno",
            Self::Magma => "magma",
            Self::Turbo => "turbo",
            Self::Grey => "grey",
        }
    }

    /// 256 colours as sRGB values.
    fn encoded(self) -> Vec<[f64; 3]> {
        if self == Self::Grey {
            return (0..256).map(|i| [f64::from(i) / 255.0; 3]).collect();
        }
        let channel = |hex: &str| u16::from_str_radix(hex, 16).map_or(0.0, |v| f64::from(v) / 65535.0);
        let color = |line: &str| [0, 4, 8].map(|at| channel(&line[at..at + 4]));
        MAPS.lines().skip_while(|line| *line != self.name()).skip(1).take(256).map(color).collect()
    }

    /// 256 colours of linear light.
    fn linear(self) -> Vec<[f64; 3]> {
        let decode = |v: f64| if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
        self.encoded().into_iter().map(|c| c.map(decode)).collect()
    }
}

impl Node for Colormap {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        tinted(inputs, &self.image, true)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let colors: Vec<f32> = self.map.linear().into_iter().flatten().map(|v| v as f32).collect();
        let colors = cx.floats("colors", &colors);
        point(cx, &self.image, shader!("colour/colormap")).read("colors", colors, Reach::Whole).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let colors = self.map.linear();
        map_tinted(cx, &self.image, true, |[r, g, b]| {
            let y = luminance([r, g, b, 1.0]);
            if y.is_nan() {
                return [y; 3];
            }
            let at = y.clamp(0.0, 1.0) * 255.0;
            let i = (at.floor() as usize).min(254);
            let t = at - i as f64;
            std::array::from_fn(|c| colors[i][c] * (1.0 - t) + colors[i + 1][c] * t)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The 8-bit colours that Matplotlib 3 gives for the ends and the middle.
    #[test]
    fn colours_are_those_of_matplotlib() {
        let expected = [
            (Map::Viridis, [[68, 1, 84], [33, 145, 140], [253, 231, 37]]),
            (Map::Inferno, [[0, 0, 4], [188, 55, 84], [252, 255, 164]]),
            (Map::Magma, [[0, 0, 4], [183, 55, 121], [252, 253, 191]]),
            (Map::Turbo, [[48, 18, 59], [164, 252, 60], [122, 4, 3]]),
            (Map::Grey, [[0; 3], [128; 3], [255; 3]]),
        ];
        for (map, colors) in expected {
            let table = map.encoded();
            assert_eq!(table.len(), 256);
            let bytes = [0, 128, 255].map(|i: usize| table[i].map(|v| (v * 255.0).round() as u8));
            assert_eq!(bytes, colors, "{map:?}");
        }
    }
}
