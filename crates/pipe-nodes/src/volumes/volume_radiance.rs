//! `VolumeRadiance`: what the eye sees of the fluence in a medium.

use std::f64::consts::PI;

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::camera::Camera;
use super::medium::{self, Extinction, Inside, Medium};
use super::phase::Phase;
use crate::shader;

/// Composites the light that a medium scatters towards the eye, from its fluence Φ as PhotonScatter counts it:
/// L = ∫ T(t)·albedo·σt·Φ/4π dt, which is (1/σt)·ΣΔΦ·P/ΔV of each voxel's photons along the ray (H. W. Jensen and
/// P. Christensen 1998, eq. 13). The light itself is not seen. Alpha is 1 − T of the whole ray.
///
/// Fluence does not tell where light comes from, so the mean of the phase function over all directions stands for it.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct VolumeRadiance {
    /// Power through a small sphere by the area of its cross-section; interpolated linearly between voxels.
    fluence: In<Volume>,
    /// What light travels through: `Homogeneous(sigma_t)`, a Volume of σt, `Scaled(volume, sigma_t)` or
    /// `CloudChamber(density_scale)`.
    #[default(medium::homogeneous())]
    medium: Medium,
    /// Where the picture is taken.
    camera: Camera,
    /// Where light goes when it is scattered: `Isotropic` is exact.
    phase: Phase,
    /// Share of the light that a collision scatters.
    #[default = 0.9]
    #[schemars(range(min = 0.0, max = 1.0))]
    albedo: f32,
    /// Pieces of the ray from the eye.
    #[default = 256]
    #[schemars(range(min = 1, max = 16384))]
    steps: u32,
}

pub(super) const KIND: Kind = Kind::of::<VolumeRadiance>(
    "VolumeRadiance",
    Category::Volumes,
    &[
        r#"VolumeRadiance(fluence: "volume", medium: Homogeneous(2), camera: (size: (9, 7)), steps: 50)"#,
        r#"VolumeRadiance(fluence: "volume", medium: "fog", camera: (eye: (2, 0.8, 1.5), size: (8, 8)), albedo: 0.5)"#,
        r#"VolumeRadiance(fluence: "fog", medium: CloudChamber, camera: (eye: (0.5, 0.5, 0.9), fov: 70, size: (7, 9)), steps: 100)"#,
    ],
)
.ports(&[("out", "radiance in R, G and B, and the opacity of the medium")])
.tolerance(1e-5, 1e-4);

impl Node for VolumeRadiance {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        medium::check(&self.medium)?;
        self.phase.check()
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        if self.phase != Phase::Isotropic {
            inputs.warn(
                Mistake::in_field("phase", "fluence does not tell where light comes from: it is scattered to all sides alike")
                    .hint("GatherWalk renders other phase functions"),
            );
        }
        Ok(Output::out(self.camera.image(4)?))
    }

    fn makes_alpha(&self) -> bool {
        true
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let inside = Inside::new(cx, &self.medium);
        let (fluence, out) = (cx.input(&self.fluence), cx.output("out"));
        let border = cx.border();
        let pass = inside
            .pass(cx, "", &shader!("volumes/volume_radiance"), &[])
            .read_with("fluence", fluence, Reach::Whole, border, Filter::Linear)
            .write("out", out)
            .constant("STEPS", self.steps as i32)
            .param("albedo", self.albedo);
        self.camera.describe(pass).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let medium = Extinction::new(cx, &self.medium);
        let fluence = cx.volume(&self.fluence);
        let scattered = |p: glam::DVec3| f64::from(self.albedo) * fluence.sample(p.to_array(), cx.border)[0] / (4.0 * PI);
        vec![Tensor::Image(self.camera.view().picture(4, |ray| medium.seen(&ray, self.steps, scattered)))]
    }
}
