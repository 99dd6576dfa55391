//! `BoxFromSat`: a box blur of any radius from four reads.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// The mean over the (2·radius + 1)² window around each pixel, from four reads of a summed-area table. At the
/// borders the mean of the part of the window that lies inside.
///
/// The sum of a window is a difference of four large sums of 24 bits each: where the table's entries are S, a
/// mean over n pixels is uncertain by about S·2⁻²³/n. For a large image and a small radius `BoxBlur` is the better
/// one.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct BoxFromSat {
    /// The summed-area table, inclusive, as `Sat` makes it.
    sat: In<Image>,
    /// How far the window extends to either side; 0 gives the summed image back.
    #[default = 8]
    #[schemars(range(min = 0, max = 16384), extend("x-unit" = "px"))]
    radius: u32,
}

pub(crate) const KIND: Kind = Kind::of::<BoxFromSat>(
    "BoxFromSat",
    Category::Analysis,
    &[
        r#"BoxFromSat(sat: "in")"#,
        r#"BoxFromSat(sat: "grey", radius: 1)"#,
        r#"BoxFromSat(sat: "pair", radius: 0)"#,
        r#"BoxFromSat(sat: "in", radius: 100)"#,
    ],
)
.tolerance(1e-5, 1e-5);

impl Node for BoxFromSat {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.sat))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (sat, out) = (cx.input(&self.sat), cx.output("out"));
        let reach = Reach::Around(self.radius + 1, self.radius + 1);
        cx.pass("", shader!("analysis/box_from_sat"))
            .entry(Entry::At)
            .read_with("sat", sat, reach, Border::Black, Filter::Nearest)
            .write("out", out)
            .param("radius", self.radius as i32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let sat = cx.image(&self.sat);
        let radius = i64::from(self.radius);
        let [w, h] = sat.size.map(i64::from);
        vec![Tensor::Image(Raster::from_fn(sat.size, sat.channels, |x, y| {
            let (x0, x1) = ((x - radius).max(0), (x + radius).min(w - 1));
            let (y0, y1) = ((y - radius).max(0), (y + radius).min(h - 1));
            let area = ((x1 - x0 + 1) * (y1 - y0 + 1)) as f64;
            let sum = |x: i64, y: i64, c: usize| if x < 0 || y < 0 { 0.0 } else { sat.at(x, y)[c] };
            std::array::from_fn(|c| (sum(x1, y1, c) - sum(x0 - 1, y1, c) - sum(x1, y0 - 1, c) + sum(x0 - 1, y0 - 1, c)) / area)
        }))]
    }
}
