//! What a whole image comes to: its mean, its spread, its extent, as scalars that stay on the GPU.
//!
//! Two dispatches. The first walks tiles and leaves a few numbers for each, the second combines them in one
//! workgroup. The order is fixed, so the same device gives the same bits; sums carry what rounding loses, so the
//! order does not show either. On a GPU a workgroup of 16×16 threads walks a tile of 64×64 pixels or more and ends
//! in a tree in workgroup memory; on a CPU each of 64 lanes walks its own columns of a tile and no one waits.
//! Rejected: atomics (no fixed order for floats) and one dispatch whose last workgroup finishes (WebGPU promises
//! no order between workgroups). NaN and ±infinity take no part in sums and extents.

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
    let sums = Sums { measure, finish, epsilon, centre: None };
    sums.lower(cx, suffix, image, view)
}

/// The standard deviation about a mean found before: √(Σ (v − mean)² / n).
pub(crate) fn deviation(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, mean: ResourceId, view: View) -> ResourceId {
    let sums = Sums { measure: 2, finish: 2, epsilon: 0.0, centre: Some(mean) };
    sums.lower(cx, suffix, image, view)
}

/// The mean of the squares of every channel.
pub(crate) fn mean_square(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId) -> ResourceId {
    let sums = Sums { measure: 2, finish: 0, epsilon: 0.0, centre: None };
    sums.lower(cx, suffix, image, View::Channels)
}

/// How many values of each channel are finite, as a float.
pub(crate) fn finite(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId) -> ResourceId {
    let sums = Sums { measure: 0, finish: 3, epsilon: 0.0, centre: None };
    sums.lower(cx, suffix, image, View::Channels)
}

/// One kind of sum, as the constants of `sum.wgsl` and `sum_total.wgsl`.
struct Sums {
    /// 0 the value, 1 its logarithm, 2 its squared distance from the centre.
    measure: i32,
    /// 0 the mean, 1 its exponential, 2 its square root, 3 the number of values.
    finish: i32,
    epsilon: f32,
    centre: Option<ResourceId>,
}

impl Sums {
    fn lower(&self, cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, view: View) -> ResourceId {
        let walk = Walk::over(cx.image_of(image).size, cx.limits().profile);
        let tiles = format!("{suffix}.tiles");
        let partials = cx.intermediate(&tiles, Shape::floats(walk.partials() * 12));
        let out = cx.intermediate(suffix, Shape::Scalar);
        let tail = match self.centre {
            Some(_) => "fn centre() -> vec4f { return load_mean(); }",
            None => "fn centre() -> vec4f { return vec4f(); }",
        };
        let pass = cx
            .pass(&tiles, extended(&shader!("analysis/sum"), tail))
            .entry(Entry::Kernel)
            .read_once("image", image)
            .write("partials", partials)
            .constant("VIEW", view as i32)
            .constant("MEASURE", self.measure)
            .param("epsilon", self.epsilon);
        let pass = match self.centre {
            Some(mean) => pass.read("mean", mean, Reach::Whole),
            None => pass,
        };
        walk.describe(pass).add();
        cx.pass(suffix, shader!("analysis/sum_total"))
            .entry(Entry::Kernel)
            .read("partials", partials, Reach::Whole)
            .write("out", out)
            .constant("FINISH", self.finish)
            .grid(Grid::Groups([1, 1, 1]))
            .add();
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
    let walk = Walk::over(cx.image_of(image).size, cx.limits().profile);
    let tiles = format!("{suffix}.tiles");
    let partials = cx.intermediate(&tiles, Shape::floats(walk.partials() * 16));
    let pass = cx
        .pass(&tiles, shader!("analysis/extent"))
        .entry(Entry::Kernel)
        .read_once("image", image)
        .write("partials", partials)
        .constant("VIEW", view as i32);
    walk.describe(pass).add();
    let mut part = |name: &str| cx.intermediate(&format!("{suffix}.{name}"), Shape::Scalar);
    let extent = Extent { min: part("min"), max: part("max"), nan: part("nan"), inf: part("inf") };
    cx.pass(suffix, shader!("analysis/extent_total"))
        .entry(Entry::Kernel)
        .read("partials", partials, Reach::Whole)
        .write("smallest", extent.min)
        .write("largest", extent.max)
        .write("nan", extent.nan)
        .write("inf", extent.inf)
        .grid(Grid::Groups([1, 1, 1]))
        .add();
    extent
}

/// How workgroups walk an image: each takes a tile, each thread the pixels of the tile at a stride of the group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Walk {
    lanes: [u32; 2],
    tile: [u32; 2],
    groups: [u32; 2],
    /// Every thread leaves its own numbers, and no thread waits for another.
    serial: bool,
}

impl Walk {
    /// The walk for an image of this size: on a GPU 64 tiles along a side at most once the image is large, on a
    /// CPU about 128 tiles.
    pub(crate) fn over(size: [u32; 2], profile: Profile) -> Self {
        let tiles = |tile: [u32; 2]| [size[0].div_ceil(tile[0]), size[1].div_ceil(tile[1])];
        match profile {
            Profile::Gpu => {
                let mut side = 64;
                while tiles([side, side]).iter().product::<u32>() > 4096 {
                    side *= 2;
                }
                Self { lanes: [16, 16], tile: [side, side], groups: tiles([side, side]), serial: false }
            }
            Profile::Cpu => {
                let width = size[0].next_multiple_of(64).min(512);
                let area = u64::from(size[0]) * u64::from(size[1]) / 128;
                let height = (area / u64::from(width)).clamp(1, 4096) as u32;
                let tile = [width, height];
                Self { lanes: [64, 1], tile, groups: tiles(tile), serial: true }
            }
        }
    }

    /// Tiles of a size given, for workgroups whose threads share their numbers.
    pub(crate) const fn tiles(size: [u32; 2], lanes: [u32; 2], tile: [u32; 2]) -> Self {
        Self { lanes, tile, groups: [size[0].div_ceil(tile[0]), size[1].div_ceil(tile[1])], serial: false }
    }

    /// How many threads or workgroups leave numbers.
    pub(crate) const fn partials(&self) -> u32 {
        let groups = self.groups[0] * self.groups[1];
        if self.serial { groups * self.lanes[0] * self.lanes[1] } else { groups }
    }

    /// Grid and constants of a kernel that walks so.
    pub(crate) fn describe<'b, 'a>(&self, pass: PassBuilder<'b, 'a>) -> PassBuilder<'b, 'a> {
        pass.constant("LANES_X", self.lanes[0] as i32)
            .constant("LANES_Y", self.lanes[1] as i32)
            .constant("TILE_X", self.tile[0] as i32)
            .constant("TILE_Y", self.tile[1] as i32)
            .constant("SERIAL", self.serial)
            .grid(Grid::Groups([self.groups[0], self.groups[1], 1]))
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
    fn a_walk_covers_every_size_with_few_partials() {
        for profile in [Profile::Gpu, Profile::Cpu] {
            for size in [[1, 1], [1, 4096], [61, 47], [3840, 2160], [16384, 16384], [16384, 1]] {
                let walk = Walk::over(size, profile);
                for axis in 0..2 {
                    assert!(walk.groups[axis] * walk.tile[axis] >= size[axis]);
                    assert!(walk.groups[axis] <= 65535);
                }
                assert!(walk.partials() <= 1 << 19, "{size:?}: {walk:?}");
                let pixels_a_thread = (walk.tile[0] / walk.lanes[0]).max(1) * (walk.tile[1] / walk.lanes[1]).max(1);
                assert!(pixels_a_thread <= 65535, "{size:?}: {walk:?}");
            }
        }
    }
}
