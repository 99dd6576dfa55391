//! `BoxBlur`: the mean over a square, at one cost for any radius.
//!
//! Along each axis a line is cut into runs no longer than a window. Every window of a run then has a part that ends where all
//! of them still are, summed from there to the left, and a part that begins there, summed to the right (M. van Herk, A Fast
//! Algorithm for Local Minimum and Maximum Filters, 1992, for sums). A running sum, which takes away what leaves, costs a
//! third less; but of a bright pixel rounding leaves something behind, of an infinite one everything.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// The longest run whose left parts a thread keeps to itself (on a GPU in registers), and the radius up to which that is
/// faster than leaving them to a pass of their own: it loads what all windows of a run hold once for each run.
const fn kept(profile: Profile, along_x: bool) -> (u32, u32) {
    match profile {
        Profile::Gpu => (16, if along_x { 16 } else { 64 }),
        Profile::Cpu => (32, 32),
    }
}

/// The mean over (2r + 1)² pixels; its cost does not depend on the radius.
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
    &[
        r#"BoxBlur(image: "in", radius: 2)"#,
        r#"BoxBlur(image: "grey", radius: 20)"#,
        r#"BoxBlur(image: "pair", radius: 40)"#,
        r#"BoxBlur(image: "in", radius: 0)"#,
    ],
)
.tolerance(2e-6, 1e-5);

/// No longer than a window, and even where that matters.
const fn run_of(window: u32, longest: u32) -> u32 {
    let run = if window < longest { window } else { longest };
    if run > 8 { run / 8 * 8 } else { run }
}

/// Declares the mean of `image` over (2r + 1)² pixels.
pub(super) fn box_mean(cx: &mut Lowering<'_>, prefix: &str, r: u32, image: ResourceId, out: ResourceId) {
    let shape = cx.shape(out);
    let rows = cx.intermediate(&format!("{prefix}rows"), shape);
    let window = 2 * r + 1;
    for (suffix, along_x, from, to) in [("rows", true, image, rows), ("columns", false, rows, out)] {
        let (longest, most) = kept(cx.limits().profile, along_x);
        let reach = if along_x { Reach::Around(r, 0) } else { Reach::Around(0, r) };
        let pass = |cx: &mut Lowering<'_>, suffix: &str, shader: Shader, run: u32, left: Option<ResourceId>, to: ResourceId| {
            let block = if along_x { [run, 1] } else { [1, run] };
            let mut pass = cx.pass(&format!("{prefix}{suffix}"), shader).entry(Entry::Each).grid(Grid::Blocks(block));
            pass = pass.read("image", from, reach);
            if let Some(left) = left {
                pass = pass.read("left", left, Reach::Point);
            }
            pass.write("out", to).constant("RADIUS", r as i32).constant("RUN", run as i32).constant("ALONG_X", along_x).add();
        };
        if r <= most {
            pass(cx, suffix, shader!("filters/box_run"), run_of(window, longest), None, to);
        } else {
            let name = format!("{suffix}.left");
            let left = cx.intermediate(&format!("{prefix}{name}"), shape);
            pass(cx, &name, shader!("filters/box_left"), window, None, left);
            pass(cx, suffix, shader!("filters/box_right"), window, Some(left), to);
        }
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
