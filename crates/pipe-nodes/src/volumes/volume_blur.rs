//! `VolumeBlur`: a Gaussian along all three axes.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::gaussian::{radius, weights};
use crate::shader;

/// Blurs with a Gaussian along x, y and z: weights exp(−k²/2σ²), k = −R..R, R = ceil(3σ), normalised to sum 1.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct VolumeBlur {
    /// The volume.
    volume: In<Volume>,
    /// Standard deviation of the Gaussian; 0 copies.
    #[default = 1.0]
    #[schemars(range(min = 0.0, max = 100.0), extend("x-unit" = "voxels"))]
    sigma: f32,
}

pub(super) const KIND: Kind = Kind::of::<VolumeBlur>(
    "VolumeBlur",
    Category::Volumes,
    &[r#"VolumeBlur(volume: "volume")"#, r#"VolumeBlur(volume: "fog", sigma: 2.5)"#, r#"VolumeBlur(volume: "fog", sigma: 0)"#],
);

impl Node for VolumeBlur {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Volume(inputs.volume(&self.volume))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let radius = radius(self.sigma);
        let values: Vec<f32> = weights(self.sigma, radius).into_iter().map(|w| w as f32).collect();
        let table = cx.floats("weights", &values);
        let mut from = cx.input(&self.volume);
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let to = if axis == 2 { cx.output("out") } else { cx.intermediate(name, cx.shape(from)) };
            cx.pass(name, shader!("volumes/volume_blur"))
                .read("volume", from, Reach::Whole)
                .read("weights", table, Reach::Whole)
                .write("out", to)
                .constant("AXIS", axis as i32)
                .constant("RADIUS", radius as i32)
                .add();
            from = to;
        }
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let radius = i64::from(radius(self.sigma));
        let weights = weights(self.sigma, radius as u32);
        let mut volume = cx.volume(&self.volume).clone();
        for axis in 0..3 {
            volume = Block::from_fn(volume.size, volume.channels, |x, y, z| {
                let mut sum = [0.0; 4];
                for (k, weight) in (-radius..=radius).zip(&weights) {
                    let mut at = [x, y, z];
                    at[axis] += k;
                    let v = volume.load(at, cx.border);
                    (0..4).for_each(|c| sum[c] += weight * v[c]);
                }
                sum
            });
        }
        vec![Tensor::Volume(volume)]
    }
}
