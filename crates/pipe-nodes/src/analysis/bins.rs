//! Which bin a value falls in, and how many pixels fall in each.
//!
//! Bins are exact: the shader compares with the true edge wherever rounding could matter, so that counts equal
//! those of a computation in double precision. Every workgroup counts its tile in workgroup memory and
//! adds that to the table once; a thread that meets the same bin again only lengthens a run, so an image of one
//! colour is no slower than any other. Tables beyond workgroup memory are counted in place.

use pipe_graph::prelude::*;

use super::reduction::{grey, walk};
use crate::shader;

/// What of a pixel is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub(crate) enum Channel {
    /// Y = 0.2126 R + 0.7152 G + 0.0722 B; the value itself of a grey pixel or of an image of 1 channel.
    #[default]
    Luminance = 0,
    /// The first channel.
    R = 1,
    /// The second channel.
    G = 2,
    /// The third channel.
    B = 3,
    /// Alpha.
    A = 4,
}

impl Channel {
    /// The twin: what of a pixel is counted.
    pub(crate) fn of(self, c: [f64; 4]) -> f64 {
        match self {
            Self::Luminance => grey(c),
            channel => c[channel as usize - 1],
        }
    }
}

/// What becomes of values outside the range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub(crate) enum Outside {
    /// They count in the first or the last bin.
    #[default]
    Clamp,
    /// They are not counted.
    Ignore,
}

/// A division of values into bins: floor((v − low)/(high − low)·bins), and v = high in the last.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Binning {
    pub(crate) bins: u32,
    pub(crate) low: Value,
    pub(crate) high: Value,
    pub(crate) channel: Channel,
    pub(crate) outside: Outside,
}

/// Most bins that are counted in workgroup memory: 16 KiB.
const PRIVATE: u32 = 4096;

/// How many pixels fall in each bin: a table of u32.
pub(crate) fn count(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, binning: &Binning) -> ResourceId {
    let walk = walk(cx.image_of(image).size, cx.limits().profile);
    let counts = cx.intermediate(suffix, Shape::uints(binning.bins));
    // A lane of a CPU counts in its own column while the columns fit.
    let columns = binning.bins * walk.lane_count();
    let columns = (cx.limits().profile == Profile::Cpu && columns <= PRIVATE).then_some(columns);
    let private = binning.bins <= PRIVATE;
    let slots = columns.unwrap_or(if private { binning.bins } else { 1 });
    let pass = cx
        .pass(suffix, if columns.is_some() { shader!("analysis/histogram_lanes") } else { shader!("analysis/histogram") })
        .entry(Entry::Fold(Workspace { own: 4 * slots, scratch: 0 }))
        .grid(Grid::Walk(walk))
        .read_once("image", image)
        .write_as("counts", counts, Access::Atomic, None)
        .constant("PRIVATE", private)
        .constant("SLOTS", slots);
    binning.describe(pass).add();
    counts
}

impl Binning {
    /// Constants and parameters of a pass that asks for bins of pixels.
    pub(crate) fn describe<'b, 'a>(&self, pass: pipe_graph::lowering::PassBuilder<'b, 'a>) -> pipe_graph::lowering::PassBuilder<'b, 'a> {
        pass.constant("BINS", self.bins as i32)
            .constant("CHANNEL", self.channel as i32)
            .constant("CLAMPED", self.outside == Outside::Clamp)
            .param("low", self.low.clone())
            .param("high", self.high.clone())
    }

    /// The twin of [`count`] over a range known now.
    pub(crate) fn count_reference(&self, image: &Raster, low: f64, high: f64) -> Vec<u64> {
        let mut counts = vec![0; self.bins as usize];
        for pixel in &image.pixels {
            if let Some(bin) = self.bin(self.channel.of(*pixel), low, high) {
                counts[bin] += 1;
            }
        }
        counts
    }

    /// The bin of a value; none for NaN and infinity.
    pub(crate) fn bin(&self, v: f64, low: f64, high: f64) -> Option<usize> {
        let last = self.bins as usize - 1;
        if !v.is_finite() || (self.outside == Outside::Ignore && !(low..=high).contains(&v)) {
            return None;
        }
        // The cast saturates: below the first bin is 0.
        Some((((v - low) / (high - low) * f64::from(self.bins)).floor() as usize).min(last))
    }
}

/// The default range: what a display shows.
pub(crate) const UNIT: (f32, f32) = (0.0, 1.0);

/// Checks that a range has an inside.
pub(crate) fn check_range(range: (f32, f32)) -> Result<(), Mistake> {
    if range.0 < range.1 {
        return Ok(());
    }
    Err(Mistake::in_field("range", format!("the range ({}, {}) holds nothing", range.0, range.1))
        .hint("give the smaller value first: `range: (0, 1)`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_half_open_but_the_last() {
        let mut binning = Binning { bins: 4, low: Value::F32(0.0), high: Value::F32(1.0), channel: Channel::R, outside: Outside::Clamp };
        let bins = |b: &Binning| [-0.1, 0.0, 0.2499, 0.25, 0.75, 1.0, 1.5, f64::INFINITY, f64::NAN].map(|v| b.bin(v, 0.0, 1.0));
        assert_eq!(bins(&binning), [Some(0), Some(0), Some(0), Some(1), Some(3), Some(3), Some(3), None, None]);
        binning.outside = Outside::Ignore;
        assert_eq!(bins(&binning), [None, Some(0), Some(0), Some(1), Some(3), Some(3), None, None, None]);
    }
}
