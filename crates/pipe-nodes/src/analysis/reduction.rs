//! What a whole image comes to: its mean, its spread, its extent, as scalars that stay on the GPU.
//!
//! Two dispatches. The first is a fold: it walks tiles and leaves a few numbers for each, and folds over the same image
//! share the walk. The second combines them in one workgroup. The order is fixed, so the same device gives the same bits;
//! sums carry what rounding loses, so the order does not show either. On a GPU a workgroup of 16×16 threads walks a tile
//! of 64×64 pixels or more and ends in a tree in workgroup memory; on a CPU each of 16 lanes walks its own columns of a
//! tile and no one waits. Rejected: atomics (no fixed order for floats) and one dispatch whose last workgroup finishes
//! (WebGPU promises no order between workgroups). NaN and ±infinity take no part in sums and extents.

use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;

use crate::shader;

/// Which mean of n values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub(crate) enum Mean {
    /// Σ v / n
    #[default]
    Arithmetic,
    /// exp(Σ log(ε + max(v, 0)) / n): what the eye adapts to.
    Geometric,
}

/// Which numbers of a pixel are measured, as the constant `VIEW` of the shaders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum View {
    /// Each channel.
    Channels = 0,
    /// The luminance, in every component.
    Luminance = 1,
    /// R, G, B and the luminance.
    ColourAndLuminance = 2,
}

/// The mean of every channel of an image, or of its luminance in every component: a scalar. Values that are not
/// finite take no part; 0 when none is left.
pub(crate) fn mean(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, mean: Mean, epsilon: f32, luminance: bool) -> ResourceId {
    let view = if luminance { View::Luminance } else { View::Channels };
    mean_of(cx, suffix, image, mean, epsilon, view)
}

/// As [`mean`], of any view.
pub(crate) fn mean_of(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, mean: Mean, epsilon: f32, view: View) -> ResourceId {
    let (measure, finish) = match mean {
        Mean::Arithmetic => (0, 0),
        Mean::Geometric => (1, 1),
    };
    let sums = Sums { measure, finish, epsilon };
    sums.lower(cx, suffix, image, view)
}

/// The mean of the squares of every channel.
pub(crate) fn mean_square(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId) -> ResourceId {
    let sums = Sums { measure: 2, finish: 0, epsilon: 0.0 };
    sums.lower(cx, suffix, image, View::Channels)
}

/// How many values of each channel are finite, as a float.
pub(crate) fn finite(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId) -> ResourceId {
    let sums = Sums { measure: 0, finish: 2, epsilon: 0.0 };
    sums.lower(cx, suffix, image, View::Channels)
}

/// The standard deviation √(Σ (v − mean)² / n), in one walk.
pub(crate) fn deviation(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, view: View) -> ResourceId {
    let partials = Partials { suffix, image, parts: 4 };
    let table = partials.walk(cx, &shader!("analysis/deviation"), |pass| pass.constant("VIEW", view as i32));
    let out = cx.intermediate(suffix, Shape::Scalar);
    partials.total(cx, &shader!("analysis/deviation_total"), table, &[("out", out)], |pass| pass);
    out
}

/// One kind of sum, as the constants of `sum.wgsl` and `sum_total.wgsl`.
struct Sums {
    /// 0 the value, 1 its logarithm, 2 its square.
    measure: i32,
    /// 0 the mean, 1 its exponential, 2 the number of values.
    finish: i32,
    epsilon: f32,
}

impl Sums {
    fn lower(&self, cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, view: View) -> ResourceId {
        let partials = Partials { suffix, image, parts: 3 };
        let table = partials.walk(cx, &shader!("analysis/sum"), |pass| {
            pass.constant("VIEW", view as i32).constant("MEASURE", self.measure).param("epsilon", self.epsilon)
        });
        let out = cx.intermediate(suffix, Shape::Scalar);
        partials.total(cx, &shader!("analysis/sum_total"), table, &[("out", out)], |pass| pass.constant("FINISH", self.finish));
        out
    }
}

/// The extent of an image: one scalar each.
pub(crate) struct Extent {
    /// Smallest finite value; 0 when there is none.
    pub(crate) min: ResourceId,
    /// Largest finite value; 0 when there is none.
    pub(crate) max: ResourceId,
    /// How many values are no number.
    pub(crate) nan: ResourceId,
    /// How many values are +∞ or −∞.
    pub(crate) inf: ResourceId,
}

/// Smallest and largest finite value, and how many values are none.
pub(crate) fn extent(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, view: View) -> Extent {
    let partials = Partials { suffix, image, parts: 4 };
    let table = partials.walk(cx, &shader!("analysis/extent"), |pass| pass.constant("VIEW", view as i32));
    let mut part = |name: &str| cx.intermediate(&format!("{suffix}.{name}"), Shape::Scalar);
    let extent = Extent { min: part("min"), max: part("max"), nan: part("nan"), inf: part("inf") };
    let outs = [("smallest", extent.min), ("largest", extent.max), ("nan", extent.nan), ("inf", extent.inf)];
    partials.total(cx, &shader!("analysis/extent_total"), table, &outs, |pass| pass);
    extent
}

/// A fold that leaves `parts` vectors of four floats for each tile, or for each lane of it.
struct Partials<'s> {
    suffix: &'s str,
    image: ResourceId,
    parts: u32,
}

impl Partials<'_> {
    /// The fold's pass; `with` adds its constants and parameters. Answers the table of what it leaves.
    fn walk<'a>(
        &self,
        cx: &mut Lowering<'a>,
        shader: &Shader,
        with: impl for<'b> FnOnce(PassBuilder<'b, 'a>) -> PassBuilder<'b, 'a>,
    ) -> ResourceId {
        let size = cx.image_of(self.image).size;
        let profile = cx.limits().profile;
        let walk = walk(size, profile);
        let lanes = walk.lane_count();
        // On a CPU no thread waits for another: each leaves its own numbers.
        let left = if profile == Profile::Cpu { lanes } else { 1 };
        let groups: u32 = walk.groups(size).iter().product();
        let tiles = format!("{}.tiles", self.suffix);
        let partials = cx.intermediate(&tiles, Shape::floats(groups * left * 4 * self.parts));
        let scratch = if left < lanes { self.parts * lanes / 2 } else { 0 };
        let pass = cx
            .pass(&tiles, extended(shader, &shader!("analysis/partials").source))
            .entry(Entry::Fold(Workspace { own: 0, scratch }))
            .grid(Grid::Walk(walk))
            .read_once("image", self.image)
            .write("partials", partials)
            .constant("PARTS", self.parts as i32)
            .constant("LEFT", left as i32);
        with(pass).add();
        partials
    }

    /// The pass that combines what the fold left, in one workgroup.
    fn total<'a>(
        &self,
        cx: &mut Lowering<'a>,
        shader: &Shader,
        table: ResourceId,
        outs: &[(&str, ResourceId)],
        with: impl for<'b> FnOnce(PassBuilder<'b, 'a>) -> PassBuilder<'b, 'a>,
    ) {
        let pass = cx
            .pass(self.suffix, extended(shader, &shader!("analysis/partials_total").source))
            .entry(Entry::Kernel)
            .read("partials", table, Reach::Whole)
            .grid(Grid::Groups([1, 1, 1]))
            .constant("PARTS", self.parts as i32);
        let pass = outs.iter().fold(pass, |pass, (port, out)| pass.write(port, *out));
        with(pass).add();
    }
}

/// Most pixels of a tile's height: images larger than memory pass by in bands of whole tiles.
const TALLEST: u32 = 128;

/// The walk of all reductions over an image of this size, so that they can share it. Tiles grow with the image, up to
/// 4096 of them for 16384×16384 pixels.
pub(crate) fn walk(size: [u32; 2], profile: Profile) -> Walk {
    match profile {
        Profile::Gpu => {
            let mut walk = Walk { lanes: [16, 16], tile: [64, 64] };
            while walk.groups(size).iter().product::<u32>() > 4096 {
                let axis = usize::from(walk.tile[1] < TALLEST);
                walk.tile[axis] *= 2;
            }
            walk
        }
        Profile::Cpu => {
            // About 128 tiles, but none so small that ending it would take longer than walking it.
            let width = size[0].next_multiple_of(64).min(512);
            let area = u64::from(size[0]) * u64::from(size[1]);
            let pixels = (area / 128).clamp(1 << 14, u64::from(512 * TALLEST)) as u32;
            Walk { lanes: [16, 1], tile: [width, (pixels / width).min(TALLEST)] }
        }
    }
}

/// A shader with a few lines of its node's behind it.
pub(crate) fn extended(shader: &Shader, tail: &str) -> Shader {
    Shader::builtin(&shader.path, &format!("{}\n{tail}\n", shader.source))
}

/// The numbers of a pixel that the twin measures.
pub(crate) fn view(raster: &Raster, view: View) -> Vec<[f64; 4]> {
    let one = |c: [f64; 4]| match view {
        View::Channels => c,
        View::Luminance => [grey(c); 4],
        View::ColourAndLuminance => [c[0], c[1], c[2], grey(c)],
    };
    raster.pixels.iter().map(|c| one(*c)).collect()
}

/// The luminance of a colour; the value itself of a grey one.
pub(crate) fn grey(c: [f64; 4]) -> f64 {
    if c[0] == c[1] && c[1] == c[2] { c[0] } else { luminance(c) }
}

/// The finite values of one component.
pub(crate) fn finite_values(pixels: &[[f64; 4]], component: usize) -> Vec<f64> {
    pixels.iter().map(|p| p[component]).filter(|v| v.is_finite()).collect()
}

/// The twin of [`mean`] for one component.
pub(crate) fn mean_reference(values: &[f64], mean: Mean, epsilon: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let n = values.len() as f64;
    match mean {
        Mean::Arithmetic => values.iter().sum::<f64>() / n,
        Mean::Geometric => (values.iter().map(|v| (epsilon + v.max(0.0)).ln()).sum::<f64>() / n).exp(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_covers_every_size_with_few_flat_tiles() {
        for profile in [Profile::Gpu, Profile::Cpu] {
            for size in [[1, 1], [1, 4096], [61, 47], [3840, 2160], [16384, 16384], [16384, 1], [1, 16384]] {
                let walk = walk(size, profile);
                let groups = walk.groups(size);
                assert!(walk.tile[1] <= TALLEST && groups.iter().all(|n| *n <= 65535), "{size:?}: {walk:?}");
                assert!(groups[0] * groups[1] <= 4096, "{size:?}: {walk:?}");
                assert!((0..2).all(|axis| groups[axis] * walk.tile[axis] >= size[axis]));
                assert!((0..2).all(|axis| walk.tile[axis].is_multiple_of(walk.lanes[axis])));
                // llvmpipe ends an invocation after 65535 iterations.
                assert!(walk.tile[0] * walk.tile[1] / walk.lane_count() <= 65535 / 2, "{size:?}: {walk:?}");
            }
        }
    }
}
