//! `Histogram`: how often each value occurs.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::bins::{self, Binning, Channel, Outside, UNIT, check_range};
use crate::shader;

/// How often each value occurs: counts of pixels in equal bins over a range, exact to the pixel.
///
/// bin = floor((v − lo)/(hi − lo)·bins), and v = hi counts in the last bin. NaN counts nowhere.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Histogram {
    /// The image to count.
    image: In<Image>,
    /// How many bins.
    #[default = 256]
    #[schemars(range(min = 2, max = 65536))]
    bins: u32,
    /// The values at the beginning of the first bin and at the end of the last: `(lo, hi)`, lo < hi.
    #[default(UNIT)]
    range: (f32, f32),
    /// What of a pixel is counted: `Luminance`, `R`, `G`, `B` or `A`.
    channel: Channel,
    /// `Atomic` counts with atomic additions in a compute pass. `Blend` draws one point for each pixel with additive
    /// blending, as the graphics pipeline has always been able to. Both give the same counts.
    method: Method,
    /// What becomes of values outside the range: `Clamp` counts them in the first or last bin,
    /// `Ignore` leaves them out. NaN and infinity are never counted; `Stats` says how many there are.
    outside: Outside,
}

/// How pixels are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
enum Method {
    /// Atomic additions.
    #[default]
    Atomic,
    /// Points with additive blending.
    Blend,
}

pub(crate) const KIND: Kind = Kind::of::<Histogram>(
    "Histogram",
    Category::Analysis,
    &[
        r#"Histogram(image: "in")"#,
        r#"Histogram(image: "in", bins: 64, channel: R, outside: Ignore)"#,
        r#"Histogram(image: "in", bins: 1000, range: (-0.5, 3.3), channel: G)"#,
        r#"Histogram(image: "grey", bins: 65536)"#,
        r#"Histogram(image: "pair", bins: 10, channel: G, range: (0.1, 0.7))"#,
        r#"Histogram(image: "in", channel: A, bins: 2)"#,
        r#"Histogram(image: "in", method: Blend)"#,
        r#"Histogram(image: "in", method: Blend, bins: 9999, channel: B, range: (-0.5, 3.3), outside: Ignore)"#,
    ],
)
.ports(&[
    ("out", "counts: a Table of u32, one entry a bin"),
    ("pdf", "probability density: a Table of f32, counts/(N·Δg) with N the number of pixels counted and Δg the width of a bin"),
]);

/// Most bins in a row of the blended target.
const ROW: u32 = 4096;

/// A float counts exactly up to 2²⁴.
const EXACT: u64 = 1 << 24;

impl Node for Histogram {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        check_range(self.range)
    }

    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let table = |element| EdgeType::table(self.bins, element);
        Ok(vec![Output::new("out", table(Element::U32)), Output::new("pdf", table(Element::F32))])
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        let counts = match self.method {
            Method::Atomic => bins::count(cx, "counts", image, &self.binning()),
            Method::Blend => self.blend(cx, image),
        };
        cx.emit("out", counts);
        let total = cx.intermediate("total", Shape::uints(1));
        cx.pass("total", shader!("analysis/table_total"))
            .entry(Entry::Kernel)
            .read("table", counts, Reach::Whole)
            .write("out", total)
            .grid(Grid::Groups([1, 1, 1]))
            .add();
        let pdf = cx.output("pdf");
        cx.pass("pdf", shader!("analysis/histogram_pdf"))
            .entry(Entry::At)
            .read("counts", counts, Reach::Whole)
            .read("total", total, Reach::Whole)
            .write("out", pdf)
            .param("width", (self.range.1 - self.range.0) / self.bins as f32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let [low, high] = [self.range.0, self.range.1].map(f64::from);
        let counts = self.binning().count_reference(cx.image(&self.image), low, high);
        let total = counts.iter().sum::<u64>().max(1) as f64;
        let width = (high - low) / f64::from(self.bins);
        let pdf = counts.iter().map(|n| *n as f64 / (total * width)).collect();
        vec![Tensor::Table(counts.iter().map(|n| *n as f64).collect()), Tensor::Table(pdf)]
    }
}

impl Histogram {
    fn binning(&self) -> Binning {
        Binning { bins: self.bins, low: self.range.0.into(), high: self.range.1.into(), channel: self.channel, outside: self.outside }
    }

    fn blend(&self, cx: &mut Lowering<'_>, image: ResourceId) -> ResourceId {
        let [w, h] = cx.image_of(image).size;
        let width = self.bins.min(ROW);
        let rows = self.bins.div_ceil(width);
        let sets = (u64::from(w) * u64::from(h)).div_ceil(EXACT) as u32;
        let blended = cx.intermediate("blended", Shape::image([width, rows * sets], 1));
        let pass = cx
            .pass("points", shader!("analysis/histogram_points"))
            .entry(Entry::Points)
            .read("image", image, Reach::Whole)
            .write("blended", blended)
            .constant("WIDTH", width as i32)
            .constant("ROWS", rows as i32)
            .constant("SETS", sets as i32)
            .grid(Grid::Elements([w * h, 1, 1]));
        self.binning().describe(pass).add();
        let counts = cx.intermediate("counts", Shape::uints(self.bins));
        cx.pass("counts", shader!("analysis/histogram_points_sum"))
            .entry(Entry::At)
            .read("blended", blended, Reach::Whole)
            .write("out", counts)
            .constant("WIDTH", width as i32)
            .constant("ROWS", rows as i32)
            .constant("SETS", sets as i32)
            .add();
        counts
    }
}
