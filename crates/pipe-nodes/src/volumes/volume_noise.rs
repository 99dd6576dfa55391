//! `VolumeNoise`: gradient noise in three dimensions, from integer hashes only.

use glam::{DVec3, IVec3};
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::resolution::{Resolution, centre};
use crate::shader;

/// Gradient noise in 0..1, one channel; the same on every device and in every run for the same seed. See K. Perlin,
/// Improving Noise, 2002.
///
/// Octaves double the frequency and halve the weight; their sum is divided by the sum of weights.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct VolumeNoise {
    /// Voxels along each edge, or [x, y, z].
    resolution: Resolution,
    /// Lattice cells along an edge of the unit cube.
    #[default = 4.0]
    #[schemars(range(min = 0.001, max = 4096.0))]
    frequency: f32,
    /// How many layers.
    #[default = 4]
    #[schemars(range(min = 1, max = 12))]
    octaves: u32,
    /// Another seed, another noise.
    seed: u32,
}

pub(super) const KIND: Kind = Kind::of::<VolumeNoise>(
    "VolumeNoise",
    Category::Volumes,
    &[
        r#"VolumeNoise(resolution: 24)"#,
        r#"VolumeNoise(resolution: [17, 9, 30], frequency: 7.5, octaves: 2, seed: 3)"#,
        r#"VolumeNoise(resolution: 16, frequency: 2, octaves: 1)"#,
    ],
)
.tolerance(1e-4, 0.0);

/// `pcg4d` of M. Jarzynski and M. Olano, Hash Functions for GPU Rendering, 2020: its first word.
fn hash(cell: IVec3, seed: u32) -> u32 {
    let step = |v: u32| v.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let [mut x, mut y, mut z, mut w] = [cell.x as u32, cell.y as u32, cell.z as u32, seed].map(step);
    let mut mix = || {
        x = x.wrapping_add(y.wrapping_mul(w));
        y = y.wrapping_add(z.wrapping_mul(x));
        z = z.wrapping_add(x.wrapping_mul(y));
        w = w.wrapping_add(y.wrapping_mul(z));
    };
    mix();
    [x, y, w] = [x, y, w].map(|v| v ^ v >> 16);
    x.wrapping_add(y.wrapping_mul(w))
}

/// The dot product of the lattice point's gradient, one of the twelve edges of a cube, with an offset.
fn gradient(cell: IVec3, seed: u32, d: DVec3) -> f64 {
    // The axis that the edge is parallel to has no part in it.
    let h = hash(cell, seed) >> 8;
    let (a, b) = match h % 3 {
        0 => (d.y, d.z),
        1 => (d.z, d.x),
        _ => (d.x, d.y),
    };
    let signed = |v: f64, negative: bool| if negative { -v } else { v };
    signed(a, h / 3 % 2 == 1) + signed(b, h / 6 % 2 == 1)
}

fn noise(p: DVec3, seed: u32) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let t = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let mut sum = 0.0;
    for corner in 0..8 {
        let offset = IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
        let far = offset.as_dvec3();
        let weights = far * t + (1.0 - far) * (1.0 - t);
        sum += weights.element_product() * gradient(cell.as_ivec3() + offset, seed, f - far);
    }
    0.5 + 0.5 * sum
}

impl Node for VolumeNoise {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(self.resolution.volume(1)?))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (out, seed) = (cx.output("out"), self.seed ^ cx.seed() as u32);
        cx.pass("", shader!("volumes/volume_noise"))
            .write("out", out)
            .constant("OCTAVES", self.octaves as i32)
            .param("frequency", self.frequency)
            .param("seed", seed)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (size, seed) = (self.resolution.size(), self.seed ^ cx.seed as u32);
        vec![Tensor::Volume(Block::from_fn(size, 1, |x, y, z| {
            let p = centre(size, [x, y, z]) * f64::from(self.frequency);
            let (mut sum, mut weights) = (0.0, 0.0);
            for octave in 0..self.octaves {
                let (f, w) = (f64::from(1_u32 << octave), 0.5_f64.powi(octave as i32));
                sum += w * noise(p * f, seed.wrapping_add(octave));
                weights += w;
            }
            [(sum / weights).clamp(0.0, 1.0); 4]
        }))]
    }
}
