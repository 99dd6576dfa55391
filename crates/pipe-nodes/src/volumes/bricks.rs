//! Empty space: the extreme density of every brick of 8×8×8 cells, so that rays leap over bricks where nothing is to see.
//!
//! A ray takes the same samples as without bricks, less those that cannot matter; so the picture is the same to the bit. An
//! octree would leap further but be read more often (a distance map likewise is one read a sample, and costs more passes).

use pipe_graph::prelude::*;

use crate::shader;

/// Cells along the edge of a brick, as in `volumes/bricks.wgsl` and `volumes/leap.wgsl`.
const EDGE: u32 = 8;

/// The greatest (or least) density that interpolation can make in each brick: a volume for the port `bricks`.
pub(super) fn extremes(cx: &mut Lowering<'_>, volume: ResourceId, border: Border, greatest: bool) -> ResourceId {
    let Shape::Volume(ty) = cx.shape(volume) else { unreachable!("the resolver bound a volume") };
    // Cells lie between voxel centres, so there is one more than voxels.
    let size = ty.size.map(|n| (n + 1).div_ceil(EDGE));
    let bricks = cx.intermediate("bricks", Shape::Volume(VolumeType { size, channels: 1, precision: Precision::F32 }));
    cx.pass("bricks", shader!("volumes/bricks"))
        .read_with("volume", volume, Reach::Whole, border, Filter::Nearest)
        .write("out", bricks)
        .constant("GREATEST", greatest)
        .add();
    bricks
}

/// A shader with `brick(p, direction)` in scope.
pub(super) fn with_bricks(shader: &Shader) -> Shader {
    Shader::builtin(&shader.path, &format!("{}\n{}", shader.source, shader!("volumes/leap").source))
}
