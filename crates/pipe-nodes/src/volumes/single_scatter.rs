//! `SingleScatter`: light that is scattered once on its way to the eye.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::camera::Camera;
use super::light::{Emitter, Light};
use super::medium::{self, Extinction, Inside, Medium};
use super::phase::Phase;
use crate::shader;

/// What the eye sees of light that is scattered exactly once: at every point of a ray through a pixel the light that
/// arrives there, weakened on its way, is scattered towards the eye, and weakened on the way to it:
/// L = ∫ T(t)·albedo·σt·p(μ)·E·T(to the light) dt. The light has the power 1 and is not seen itself.
///
/// Alpha is 1 − T of the whole ray: what the medium hides of a background.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct SingleScatter {
    /// What light travels through: `Homogeneous(sigma_t)`, a Volume of σt, `Scaled(volume, sigma_t)` or
    /// `CloudChamber(density_scale)`.
    #[default(medium::homogeneous())]
    medium: Medium,
    /// Where light comes from: `Point([x, y, z])` or `Plane(origin, normal, size)`, `size` a side or both.
    light: Light,
    /// Where the picture is taken.
    camera: Camera,
    /// Where light goes when it is scattered.
    phase: Phase,
    /// Share of the light that a collision scatters.
    #[default = 0.9]
    #[schemars(range(min = 0.0, max = 1.0))]
    albedo: f32,
    /// Pieces of the ray from the eye, and of each ray to the light.
    #[default = 128]
    #[schemars(range(min = 1, max = 4096))]
    steps: u32,
}

pub(super) const KIND: Kind = Kind::of::<SingleScatter>(
    "SingleScatter",
    Category::Volumes,
    &[
        r#"SingleScatter(medium: Homogeneous(2), light: Point([0.3, 1.2, 0.4]), camera: (size: (9, 7)), steps: 20)"#,
        r#"SingleScatter(medium: "fog", light: Plane([0.5, 1, 0.5], [0.2, -1, 0.1], [0.7, 0.9]), camera: (eye: (2, 0.8, 1.5), size: (8, 8)), phase: HenyeyGreenstein(0.6), steps: 64)"#,
        r#"SingleScatter(medium: CloudChamber(2), light: Point([0.5, 0.95, 0.5]), camera: (eye: (0.5, 0.5, 0.9), fov: 70, size: (7, 9)), phase: Rayleigh, steps: 60)"#,
    ],
)
.ports(&[("out", "radiance in R, G and B, and the opacity of the medium")])
.tolerance(1e-5, 1e-4);

/// Points of the medium that a thread asks in one dispatch.
const POINTS: u32 = 2048;

impl Node for SingleScatter {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        medium::check(&self.medium)?;
        self.phase.check()?;
        self.light.check_visible()
    }

    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(self.camera.image(4)?))
    }

    fn makes_alpha(&self) -> bool {
        true
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let inside = Inside::new(cx, &self.medium);
        let EdgeType::Image(ty) = self.camera.image(4)? else { unreachable!("a camera makes images") };
        let begin = cx.intermediate("begin", Shape::Image(ty));
        let nothing = Shader::builtin("volumes/single_scatter.wgsl", "fn apply() -> vec4f { return vec4f(); }");
        cx.pass("begin", nothing).entry(Entry::Point).write("out", begin).add();
        let shadow = if inside.is_homogeneous() { 0 } else { self.steps };
        let pieces = (POINTS / (1 + shadow)).clamp(1, self.steps);
        let count = Count::Fixed(self.steps.div_ceil(pieces));
        let end = cx.repeat("pieces", count, &[begin], |cx, states| {
            let next = cx.intermediate("pieces", Shape::Image(ty));
            let pass = inside
                .pass(cx, "pieces", &shader!("volumes/single_scatter"), &[shader!("volumes/arrival")])
                .read("state", states[0], Reach::Point)
                .write("out", next)
                .constant("STEPS", self.steps as i32)
                .constant("PIECES", pieces as i32)
                .constant("UNIFORM", inside.is_homogeneous())
                .constant("PHASE", self.phase.code())
                .param("g", self.phase.g())
                .param("albedo", self.albedo);
            self.camera.describe(self.light.describe(pass)).add();
            Ok(vec![next])
        })?;
        let out = cx.output("out");
        cx.pass("", shader!("volumes/seen")).entry(Entry::Point).read("state", end[0], Reach::Point).write("out", out).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let medium = Extinction::new(cx, &self.medium);
        let emitter = self.light.shape();
        vec![Tensor::Image(self.camera.view().picture(4, |ray| {
            medium.seen(&ray, self.steps, |p| f64::from(self.albedo) * self.scattered(&medium, &emitter, p, ray.direction))
        }))]
    }
}

impl SingleScatter {
    /// Radiance that is scattered at p towards the eye, per unit of σs.
    fn scattered(&self, medium: &Extinction<'_>, emitter: &Emitter, p: glam::DVec3, direction: glam::DVec3) -> f64 {
        let Some(light) = emitter.at(p) else { return 0.0 };
        let arrives = light.irradiance * (-medium.depth_to(p, &light, self.steps)).exp();
        arrives * self.phase.density(light.towards.dot(direction))
    }
}
