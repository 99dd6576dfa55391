//! `Dither`: few levels, with thresholds that change from pixel to pixel.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::blue_noise::{SIDE, ranks};
use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// Reduces colour, clamped to 0..1, to a number of levels so that the mean over some pixels stays:
/// floor(v·(levels − 1) + t)/(levels − 1), t the threshold of the pixel, evenly spread in 0..1. Alpha is kept.
///
/// All channels share a pixel's threshold, so grey stays grey. To dither for an 8-bit file, encode first:
/// `Colorspace(to: "srgb")`, `Dither(levels: 256)`, `Colorspace(from: "srgb")`.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Dither {
    /// The image.
    image: In<Image>,
    /// How many levels, 2 or more.
    #[default = 8]
    #[schemars(range(min = 2, max = 65536))]
    levels: u32,
    /// The thresholds.
    kind: Pattern,
}

/// Patterns of thresholds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
enum Pattern {
    /// The ordered 8×8 matrix of B. E. Bayer (1973).
    #[default]
    Bayer8,
    /// 64×64 thresholds without low frequencies: void-and-cluster, R. Ulichney (1993).
    Blue,
}

pub(super) const KIND: Kind = Kind::of::<Dither>(
    "Dither",
    Category::Colour,
    &[
        r#"Dither(image: "in", levels: 4)"#,
        r#"Dither(image: "in", levels: 2, kind: Blue)"#,
        r#"Dither(image: "grey", levels: 256, kind: Blue)"#,
        r#"Dither(image: "grey")"#,
    ],
);

/// Entry (x, y) of Bayer's matrix: M(2n) = [4M, 4M + 2; 4M + 3, 4M + 1], unrolled three times.
fn bayer(x: u32, y: u32) -> u32 {
    (0..3)
        .map(|bit| {
            let (x, y) = ((x >> bit) & 1, (y >> bit) & 1);
            (2 * (x ^ y) + y) << (2 * (2 - bit))
        })
        .sum()
}

impl Pattern {
    const fn side(self) -> usize {
        match self {
            Self::Bayer8 => 8,
            Self::Blue => SIDE,
        }
    }

    /// Thresholds in 0..1, both ends excluded, row by row.
    fn thresholds(self) -> Vec<f32> {
        let place = |rank: u32, of: f32| (rank as f32 + 0.5) / of;
        match self {
            Self::Bayer8 => (0..64).map(|i| place(bayer(i % 8, i / 8), 64.0)).collect(),
            Self::Blue => ranks().iter().map(|r| place(u32::from(*r), 4096.0)).collect(),
        }
    }
}

impl Node for Dither {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let thresholds = cx.floats("thresholds", &self.kind.thresholds());
        point(cx, &self.image, shader!("colour/dither"))
            .read("thresholds", thresholds, Reach::Whole)
            .constant("SIDE", self.kind.side() as i32)
            .param("steps", (self.levels - 1) as f32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (side, thresholds) = (self.kind.side(), self.kind.thresholds());
        let width = cx.image(&self.image).size[0] as usize;
        let pixel = std::cell::Cell::new(0);
        let steps = self.levels - 1;
        map_rgb(cx, &self.image, |c| {
            let i = pixel.replace(pixel.get() + 1);
            let t = thresholds[(i / width % side) * side + i % width % side];
            // In 32 bits, so that a value on an edge falls to the same side.
            let level = |v: f64| (v.clamp(0.0, 1.0) as f32 * steps as f32 + t).floor();
            c.map(|v| if v.is_nan() { v } else { f64::from(level(v)).min(f64::from(steps)) / f64::from(steps) })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The matrix as it is printed everywhere (J. F. Jarvis, C. N. Judice, W. H. Ninke 1976).
    #[test]
    fn bayers_matrix() {
        let row = |y| [0, 1, 2, 3, 4, 5, 6, 7].map(|x| bayer(x, y));
        assert_eq!(row(0), [0, 32, 8, 40, 2, 34, 10, 42]);
        assert_eq!(row(1), [48, 16, 56, 24, 50, 18, 58, 26]);
        assert_eq!(row(2), [12, 44, 4, 36, 14, 46, 6, 38]);
        assert_eq!(row(7), [63, 31, 55, 23, 61, 29, 53, 21]);
    }
}
