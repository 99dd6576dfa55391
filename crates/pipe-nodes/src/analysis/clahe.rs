//! `Clahe`: contrast-limited adaptive histogram equalization (Zuiderveld, Graphics Gems IV, 1994).

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::bins::{UNIT, check_range};
use super::reduction::grey;
use crate::shader;

/// Local contrast: equalizes the luminance of each region by its own histogram, without overdoing it.
///
/// The image is divided into `tiles` × `tiles` tiles. In each, the histogram of the luminance is clipped at `clip`
/// times its mean count, what is cut off is spread over all bins, and the cumulative share becomes the tile's
/// curve. A pixel goes through the curves of the four nearest tiles, interpolated between their centres. Curves are
/// straight inside a bin, so the result has no steps. Colours are scaled by H/Y, an image of 1 channel becomes H,
/// 0..1; alpha is kept, and a colour without positive luminance becomes black.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Clahe {
    /// The image to equalize.
    image: In<Image>,
    /// How many tiles there are along each axis; fewer where the image has fewer pixels.
    #[default = 8]
    #[schemars(range(min = 1, max = 64))]
    tiles: u32,
    /// Most that a bin may count, as a multiple of the mean count of all bins (and at least one pixel): 1 hardly
    /// changes the image, 4 is strong, a value of `bins` or more is plain adaptive equalization.
    #[default = 2.0]
    #[schemars(range(min = 0.0, max = 65536.0))]
    clip: f32,
    /// How many bins the histograms have.
    #[default = 256]
    #[schemars(range(min = 2, max = 4096))]
    bins: u32,
    /// The luminances that the histograms span: `(lo, hi)`, lo < hi. What lies outside counts in the first or last bin.
    #[default(UNIT)]
    range: (f32, f32),
}

pub(crate) const KIND: Kind = Kind::of::<Clahe>(
    "Clahe",
    Category::Analysis,
    &[
        r#"Clahe(image: "grey")"#,
        r#"Clahe(image: "in", tiles: 3, clip: 4)"#,
        r#"Clahe(image: "in", tiles: 1, clip: 4096, bins: 4096, range: (-0.5, 9))"#,
        r#"Clahe(image: "pair", tiles: 5, clip: 0)"#,
    ],
);

impl Node for Clahe {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        check_range(self.range)
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let ty = cx.image_of(image);
        let [across, down] = self.tiles(ty.size);
        let [low, high] = [self.range.0, self.range.1];
        let len = across * down * self.bins;
        let counts = cx.intermediate("histograms", Shape::uints(len));
        // Each tile is counted by as many workgroups as keep the device busy.
        let parts = (1024 / (across * down)).clamp(1, ty.size[1].div_ceil(down));
        cx.pass("histograms", shader!("analysis/clahe_count"))
            .entry(Entry::Kernel)
            .read("image", image, Reach::Whole)
            .write_as("counts", counts, Access::Atomic, None)
            .constant("TILES_X", across as i32)
            .constant("TILES_Y", down as i32)
            .constant("BINS", self.bins as i32)
            .param("low", low)
            .param("high", high)
            .grid(Grid::Groups([across, down, parts]))
            .add();
        let curves = cx.intermediate("curves", Shape::floats(len));
        cx.pass("curves", shader!("analysis/clahe_curve"))
            .entry(Entry::Kernel)
            .read("counts", counts, Reach::Whole)
            .write("curves", curves)
            .constant("BINS", self.bins as i32)
            .param("clip", self.clip)
            .grid(Grid::Groups([across * down, 1, 1]))
            .add();
        cx.pass("", shader!("analysis/clahe"))
            .entry(Entry::Point)
            .read("image", image, Reach::Point)
            .read("curves", curves, Reach::Whole)
            .write("out", out)
            .constant("TILES_X", across as i32)
            .constant("TILES_Y", down as i32)
            .constant("BINS", self.bins as i32)
            .constant("GREY", ty.channels == 1)
            .param("low", low)
            .param("high", high)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let tiles = self.tiles(image.size).map(i64::from);
        let [w, h] = image.size.map(i64::from);
        let curves: Vec<Vec<f64>> = (0..tiles[0] * tiles[1])
            .map(|t| {
                let (tx, ty) = (t % tiles[0], t / tiles[0]);
                let mut values = Vec::new();
                for y in ty * h / tiles[1]..(ty + 1) * h / tiles[1] {
                    for x in tx * w / tiles[0]..(tx + 1) * w / tiles[0] {
                        values.push(grey(image.at(x, y)));
                    }
                }
                self.curve_reference(&values)
            })
            .collect();
        vec![Tensor::Image(Raster::from_fn(image.size, image.channels, |x, y| {
            let c = image.at(x, y);
            let luminance = grey(c);
            if !luminance.is_finite() {
                return c;
            }
            // The place among the centres of the tiles, and the two nearest tiles along an axis.
            let between = |i: i64, n: i64, tiles: i64| {
                let u = (i as f64 + 0.5) * tiles as f64 / n as f64 - 0.5;
                let first = u.floor();
                ([first as i64, first as i64 + 1].map(|t| t.clamp(0, tiles - 1)), u - first)
            };
            let (columns, fx) = between(x, w, tiles[0]);
            let (rows, fy) = between(y, h, tiles[1]);
            let at = |row: usize, column: usize| self.through(&curves[(rows[row] * tiles[0] + columns[column]) as usize], luminance);
            let level = (at(0, 0) * (1.0 - fx) + at(0, 1) * fx) * (1.0 - fy) + (at(1, 0) * (1.0 - fx) + at(1, 1) * fx) * fy;
            match image.channels {
                1 => [level; 4],
                _ if luminance <= 0.0 => [0.0, 0.0, 0.0, c[3]],
                _ => [c[0] / luminance * level, c[1] / luminance * level, c[2] / luminance * level, c[3]],
            }
        }))]
    }
}

impl Clahe {
    /// Tiles along x and y, none of them empty.
    fn tiles(&self, size: [u32; 2]) -> [u32; 2] {
        size.map(|n| self.tiles.min(n))
    }

    fn position(&self, luminance: f64) -> f64 {
        let [low, high] = [self.range.0, self.range.1].map(f64::from);
        ((luminance - low) / (high - low) * f64::from(self.bins)).clamp(0.0, f64::from(self.bins))
    }

    /// The curve of a tile: the share of its pixels up to the upper end of every bin, after clipping.
    fn curve_reference(&self, values: &[f64]) -> Vec<f64> {
        let bins = self.bins as usize;
        let mut counts = vec![0.0; bins];
        for v in values.iter().filter(|v| v.is_finite()) {
            counts[(self.position(*v) as usize).min(bins - 1)] += 1.0;
        }
        let area: f64 = counts.iter().sum();
        let limit = (f64::from(self.clip) * area / bins as f64).max(1.0);
        let excess: f64 = counts.iter().map(|n| (n - limit).max(0.0)).sum();
        let mut sum = 0.0;
        let shares = counts.iter().map(|n| {
            sum += n.min(limit) + excess / bins as f64;
            sum / area.max(1.0)
        });
        shares.collect()
    }

    /// A luminance through a curve, straight inside a bin.
    fn through(&self, curve: &[f64], luminance: f64) -> f64 {
        let position = self.position(luminance);
        let bin = (position as usize).min(curve.len() - 1);
        let below = if bin == 0 { 0.0 } else { curve[bin - 1] };
        below + (position - bin as f64) * (curve[bin] - below)
    }
}
