//! `Equalize`: histogram equalization.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::bins::{self, Binning, Channel, Outside, UNIT, check_range};
use super::prefix::{FAST_RADIX, scan};
use super::reduction::grey;
use crate::shader;

/// Spreads the luminances of an image evenly over the grey levels.
///
/// Each pixel of luminance Y gets H = floor((levels − 1)·CDF(bin(Y)))/(levels − 1), where CDF is the share of pixels
/// whose bin is at most its own. Colours are scaled by H/Y, so hue and saturation stay; an image of 1 channel
/// becomes H. Alpha is kept; a colour without positive luminance becomes black. Luminances outside the range count
/// in the first or last bin.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Equalize {
    /// The image to equalize.
    image: In<Image>,
    /// How many bins the histogram has.
    #[default = 256]
    #[schemars(range(min = 2, max = 65536))]
    bins: u32,
    /// The luminances that the histogram spans: `(lo, hi)`, lo < hi.
    #[default(UNIT)]
    range: (f32, f32),
    /// How many grey levels the result has. As many as there are bins when absent.
    #[schemars(range(min = 2, max = 65536))]
    levels: Option<u32>,
}

pub(crate) const KIND: Kind = Kind::of::<Equalize>(
    "Equalize",
    Category::Analysis,
    &[
        r#"Equalize(image: "grey")"#,
        r#"Equalize(image: "in")"#,
        r#"Equalize(image: "in", bins: 1024, range: (0, 4), levels: 16)"#,
        r#"Equalize(image: "pair", bins: 65536)"#,
    ],
);

impl Node for Equalize {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        check_range(self.range)
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let binning = self.binning();
        let counts = bins::count(cx, "histogram", image, &binning);
        let cumulative = scan(cx, "cdf", counts, true, FAST_RADIX);
        let curve = cx.intermediate("curve", Shape::floats(self.bins));
        cx.pass("curve", shader!("analysis/equalize_curve"))
            .entry(Entry::At)
            .read("cumulative", cumulative, Reach::Whole)
            .write("out", curve)
            .constant("STEPS", self.levels() - 1)
            .add();
        let grey = cx.image_of(image).channels == 1;
        let pass = cx
            .pass("", shader!("analysis/equalize"))
            .entry(Entry::Point)
            .read("image", image, Reach::Point)
            .read("curve", curve, Reach::Whole)
            .write("out", out)
            .constant("GREY", grey);
        binning.describe(pass).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let binning = self.binning();
        let [low, high] = [self.range.0, self.range.1].map(f64::from);
        let counts = binning.count_reference(image, low, high);
        let total = counts.iter().sum::<u64>().max(1);
        let steps = u64::from(self.levels() - 1);
        let mut sum = 0;
        let level = |n: &u64| {
            sum += n;
            (steps * sum / total) as f64 / steps as f64
        };
        let levels: Vec<_> = counts.iter().map(level).collect();
        vec![Tensor::Image(image.map(image.channels, |c| {
            let y = grey(c);
            let Some(bin) = binning.bin(y, low, high) else { return c };
            match image.channels {
                1 => [levels[bin]; 4],
                _ if y <= 0.0 => [0.0, 0.0, 0.0, c[3]],
                _ => [c[0] / y * levels[bin], c[1] / y * levels[bin], c[2] / y * levels[bin], c[3]],
            }
        }))]
    }
}

impl Equalize {
    fn levels(&self) -> u32 {
        self.levels.unwrap_or(self.bins)
    }

    fn binning(&self) -> Binning {
        Binning {
            bins: self.bins,
            low: self.range.0.into(),
            high: self.range.1.into(),
            channel: Channel::Luminance,
            outside: Outside::Clamp,
        }
    }
}
