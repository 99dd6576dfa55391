//! `VolumeResample`: a volume with more or fewer voxels.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::resolution::Resolution;
use crate::shader;

/// The same volume in another resolution. `Linear` is a tent as wide as two voxels of the coarser side, normalised to sum 1,
/// so that shrinking averages and enlarging interpolates; `Nearest` takes the voxel that holds the new voxel's centre.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct VolumeResample {
    /// The volume.
    volume: In<Volume>,
    /// Voxels along each edge, or [x, y, z].
    resolution: Resolution,
    /// Between voxel centres.
    filter: Sampling,
}

/// Between voxel centres.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Sampling {
    /// One voxel.
    Nearest,
    /// A tent.
    #[default]
    Linear,
}

pub(super) const KIND: Kind = Kind::of::<VolumeResample>(
    "VolumeResample",
    Category::Volumes,
    &[
        r#"VolumeResample(volume: "volume", resolution: 32)"#,
        r#"VolumeResample(volume: "volume", resolution: [7, 18, 40])"#,
        r#"VolumeResample(volume: "fog", resolution: [5, 40, 3], filter: Nearest)"#,
        r#"VolumeResample(volume: "fog", resolution: 1)"#,
    ],
);

impl Node for VolumeResample {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(self.resolution.volume(inputs.volume(&self.volume).channels)?))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let mut from = cx.input(&self.volume);
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let Shape::Volume(mut ty) = cx.shape(from) else { unreachable!("the resolver bound a volume") };
            ty.size[axis] = self.resolution.size()[axis];
            let to = if axis == 2 { cx.output("out") } else { cx.intermediate(name, Shape::Volume(ty)) };
            cx.pass(name, shader!("volumes/volume_resample"))
                .read("volume", from, Reach::Whole)
                .write("out", to)
                .constant("AXIS", axis as i32)
                .constant("LINEAR", self.filter == Sampling::Linear)
                .add();
            from = to;
        }
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let mut volume = cx.volume(&self.volume).clone();
        for axis in 0..3 {
            let mut size = volume.size;
            size[axis] = self.resolution.size()[axis];
            let ratio = f64::from(volume.size[axis]) / f64::from(size[axis]);
            let half = if self.filter == Sampling::Linear { ratio.max(1.0) } else { 0.0 };
            volume = Block::from_fn(size, volume.channels, |x, y, z| {
                let at = [x, y, z];
                let load = |mut at: [i64; 3], i: i64| {
                    at[axis] = i;
                    volume.load(at, cx.border)
                };
                let place = (at[axis] as f64 + 0.5) * ratio;
                if half == 0.0 {
                    return load(at, place.floor() as i64);
                }
                let (mut sum, mut weights) = ([0.0; 4], 0.0);
                for i in (place - 0.5 - half).ceil() as i64..=(place - 0.5 + half).floor() as i64 {
                    let weight = 1.0 - (i as f64 + 0.5 - place).abs() / half;
                    let v = load(at, i);
                    (0..4).for_each(|c| sum[c] += weight * v[c]);
                    weights += weight;
                }
                sum.map(|v| v / weights)
            });
        }
        vec![Tensor::Volume(volume)]
    }
}
