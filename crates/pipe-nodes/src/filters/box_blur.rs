//! `BoxBlur`: the mean over a square, at one cost for any radius.
//!
//! Along each axis a thread makes a run of pixels: the first sum is added up, the next ones add what enters and take away
//! what leaves. Runs begin anew every [`RUN`] pixels (more for large radii), so rounding does not pile up, and a pixel that
//! is not finite spoils no pixel beyond its run.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// The shortest run of one thread.
const RUN: u32 = 32;

/// The mean over (2r + 1)² pixels; its cost does not depend on the radius.
///
/// Sums run along lines and begin anew every few pixels; a value that is not finite may reach pixels up to two radii away.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct BoxBlur {
    /// The image.
    image: In<Image>,
    /// Pixels to either side; 0 copies.
    #[default = 1]
    #[schemars(range(min = 0, max = 8192), extend("x-unit" = "px"))]
    radius: u32,
}

pub(super) const KIND: Kind = Kind::of::<BoxBlur>(
    "BoxBlur",
    Category::Filters,
    &[r#"BoxBlur(image: "in", radius: 2)"#, r#"BoxBlur(image: "grey", radius: 20)"#, r#"BoxBlur(image: "in", radius: 0)"#],
)
.tolerance(2e-6, 1e-5);

/// Declares the mean of `image` over (2r + 1)² pixels.
pub(super) fn box_mean(cx: &mut Lowering<'_>, prefix: &str, r: u32, image: ResourceId, out: ResourceId) {
    let shape = cx.shape(out);
    let rows = cx.intermediate(&format!("{prefix}rows"), shape);
    let run = RUN.max(r);
    for (suffix, along_x, from, to) in [("rows", true, image, rows), ("columns", false, rows, out)] {
        // A run also sees what entered and left since it began.
        let reach = if along_x { Reach::Around(r + run, 0) } else { Reach::Around(0, r + run) };
        let block = if along_x { [run, 1] } else { [1, run] };
        cx.pass(&format!("{prefix}{suffix}"), shader!("filters/box_blur"))
            .entry(Entry::Each)
            .grid(Grid::Blocks(block))
            .read("image", from, reach)
            .write("out", to)
            .constant("RADIUS", r as i32)
            .constant("RUN", run as i32)
            .constant("ALONG_X", along_x)
            .add();
    }
}

/// The twin of [`box_mean`].
pub(super) fn box_mean_reference(image: &Raster, radius: u32, border: Border) -> Raster {
    let r = i64::from(radius);
    let n = (2 * r + 1) as f64;
    let pass = |image: &Raster, dx: i64, dy: i64| {
        Raster::from_fn(image.size, image.channels, |x, y| {
            let mut sum = [0.0; 4];
            for k in -r..=r {
                let p = image.load(x + k * dx, y + k * dy, border);
                for c in 0..4 {
                    sum[c] += p[c] / n;
                }
            }
            sum
        })
    };
    pass(&pass(image, 1, 0), 0, 1)
}

impl Node for BoxBlur {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        if self.radius == 0 && cx.pass_on("out", image) {
            return Ok(());
        }
        let out = cx.output("out");
        box_mean(cx, "", self.radius, image, out);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        vec![Tensor::Image(box_mean_reference(cx.image(&self.image), self.radius, cx.border))]
    }
}
