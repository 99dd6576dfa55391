//! `VolumeGradient`: how fast a volume changes, and whither.

use glam::DVec3;
use pipe_graph::prelude::*;

use crate::shader;

/// The gradient of the first channel by central differences over two voxels, per length of the unit cube. Red, green and
/// blue are the derivatives along x, y and z, alpha is the gradient's length.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct VolumeGradient {
    /// The volume.
    volume: In<Volume>,
}

pub(super) const KIND: Kind = Kind::of::<VolumeGradient>(
    "VolumeGradient",
    Category::Volumes,
    &[r#"VolumeGradient(volume: "volume")"#, r#"VolumeGradient(volume: "fog")"#],
);

impl Node for VolumeGradient {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Volume(VolumeType { channels: 4, ..inputs.volume(&self.volume) })))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (volume, out) = (cx.input(&self.volume), cx.output("out"));
        cx.pass("", shader!("volumes/volume_gradient")).read("volume", volume, Reach::Whole).write("out", out).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let volume = cx.volume(&self.volume);
        vec![Tensor::Volume(Block::from_fn(volume.size, 4, |x, y, z| {
            let g: DVec3 = std::array::from_fn(|axis| {
                let beside = |step: i64| {
                    let mut at = [x, y, z];
                    at[axis] += step;
                    volume.load(at, cx.border)[0]
                };
                (beside(1) - beside(-1)) * f64::from(volume.size[axis]) / 2.0
            })
            .into();
            [g.x, g.y, g.z, g.length()]
        }))]
    }
}
