//! `Histogram2d`: how often two channels have which values together.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::bins::{Binning, Channel, Outside, UNIT, check_range};
use super::scope::{Layout, Scope};
use crate::shader;

/// A picture of how often two channels have which values together: `x` to the right, `y` upwards, brightness
/// log(1 + n)/log(1 + largest n), 1 channel.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Histogram2d {
    /// The image to count.
    image: In<Image>,
    /// The channel along x: `Luminance`, `R`, `G`, `B` or `A`.
    #[default(Channel::R)]
    x: Channel,
    /// The channel along y.
    #[default(Channel::G)]
    y: Channel,
    /// How many bins along each axis: the width and height of the picture.
    #[default = 256]
    #[schemars(range(min = 2, max = 4096))]
    bins: u32,
    /// The values at the first and last edge, `(lo, hi)`, of both axes.
    #[default(UNIT)]
    range: (f32, f32),
    /// What becomes of pixels with a value outside the range: `Clamp` counts them at the edge, `Ignore` nowhere.
    outside: Outside,
}

pub(crate) const KIND: Kind = Kind::of::<Histogram2d>(
    "Histogram2d",
    Category::Analysis,
    &[
        r#"Histogram2d(image: "in")"#,
        r#"Histogram2d(image: "in", x: Luminance, y: B, bins: 64, range: (-0.5, 3.3), outside: Ignore)"#,
        r#"Histogram2d(image: "pair", bins: 32)"#,
    ],
)
.ports(&[("out", "the picture"), ("counts", "the counts: a Table of u32, bins² entries, y·bins + x")]);

impl Node for Histogram2d {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        check_range(self.range)
    }

    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let counts = EdgeType::table(self.bins * self.bins, Element::U32);
        Ok(vec![Output::new("out", EdgeType::Image(self.scope().image())), Output::new("counts", counts)])
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out, counts) = (cx.input(&self.image), cx.output("out"), cx.output("counts"));
        let pass = cx
            .pass("counts", shader!("analysis/histogram2d"))
            .entry(Entry::Each)
            .read("image", image, Reach::Point)
            .write_as("counts", counts, Access::Atomic, None)
            .constant("CHANNEL_Y", self.y as i32)
            .grid(Grid::Blocks([1, 1]));
        self.binning(self.x).describe(pass).add();
        self.scope().show(cx, counts, out);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let [low, high] = [self.range.0, self.range.1].map(f64::from);
        let mut counts = vec![0; (self.bins * self.bins) as usize];
        for pixel in &cx.image(&self.image).pixels {
            let bin = |c: Channel| self.binning(c).bin(c.of(*pixel), low, high);
            if let (Some(x), Some(y)) = (bin(self.x), bin(self.y)) {
                counts[y * self.bins as usize + x] += 1;
            }
        }
        let picture = self.scope().show_reference(&counts);
        vec![Tensor::Image(picture), Tensor::Table(counts.iter().map(|n| *n as f64).collect())]
    }
}

impl Histogram2d {
    const fn scope(&self) -> Scope {
        Scope { width: self.bins, height: self.bins, layout: Layout::Grey }
    }

    fn binning(&self, channel: Channel) -> Binning {
        Binning { bins: self.bins, low: self.range.0.into(), high: self.range.1.into(), channel, outside: self.outside }
    }
}
