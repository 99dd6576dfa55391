//! `GatherWalk`: light that random walks from the eye find.

use glam::DVec3;
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::camera::{Camera, Ray};
use super::dispatches::Dispatches;
use super::light::{Emitter, Light};
use super::medium::{self, Extinction, Inside, Medium};
use super::phase::Phase;
use super::random::{exponential, open_unit, philox};
use crate::shader;

/// What the eye sees of light that is scattered up to `max_bounces` times: the mean over `paths` random walks through each
/// pixel. A walk collides as light would; at each collision a shadow ray asks how much light arrives from the light itself
/// (next-event estimation), and the walk goes on in a direction of the phase function. The light has the power 1 and is not
/// seen itself.
///
/// Alpha is the share of walks that met the medium: what it hides of a background. The same seed gives the same bits.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct GatherWalk {
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
    /// Walks through each pixel.
    #[default = 64]
    #[schemars(range(min = 1, max = 1_000_000))]
    paths: u32,
    /// Collisions after which a walk ends; 1 is single scattering.
    #[default = 64]
    #[schemars(range(min = 1, max = 1_000_000))]
    max_bounces: u32,
    /// Another seed, other walks.
    seed: u32,
}

pub(super) const KIND: Kind = Kind::of::<GatherWalk>(
    "GatherWalk",
    Category::Volumes,
    &[
        r#"GatherWalk(medium: Homogeneous(3), light: Point([0.3, 1.2, 0.4]), camera: (size: (6, 5)), paths: 3)"#,
        r#"GatherWalk(medium: "fog", light: Plane([0.5, 1, 0.5], [0.2, -1, 0.1], 0.7), camera: (eye: (2, 0.8, 1.5), size: (6, 6)), phase: HenyeyGreenstein(0.6), paths: 4, max_bounces: 5)"#,
        r#"GatherWalk(medium: CloudChamber, light: Point([0.5, 0.95, 0.5]), camera: (eye: (0.5, 0.5, 0.9), fov: 70, size: (5, 6)), phase: Rayleigh, paths: 2, max_bounces: 4, seed: 5)"#,
    ],
)
.ports(&[("out", "radiance in R, G and B, and the opacity of the medium")])
// The twin walks the same paths. Light falls off from a point by the square of its distance, which enlarges rounding.
.tolerance(1e-4, 1e-3)
// A path whose fate hangs on the last digit: one of the thirty pixels of an example, all its channels.
.strays(0.04);

/// Words that a lane keeps.
const LANE: u32 = 15;

/// Words of `score`: see `gather.wgsl`.
const SCORE: u32 = 3;

/// More steps than the walks of a pixel should take.
const MOST_STEPS: u64 = 1 << 36;

impl Node for GatherWalk {
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
        let out = cx.output("out");
        let size = cx.image_of(out).size;
        let pixels = size[0] * size[1];
        let dispatches = Dispatches::new(cx.limits().profile, pixels);
        let tables =
            [("lanes", Shape::uints(LANE * dispatches.lanes)), ("score", Shape::uints(SCORE)), ("pixels", Shape::floats(2 * pixels))];
        let begin = tables.map(|(name, shape)| {
            let zeros = cx.intermediate(name, shape);
            let ty = if name == "pixels" { "f32" } else { "u32" };
            let text = format!("fn at(i: i32) -> {ty} {{ return {ty}(0); }}");
            cx.pass(name, Shader::builtin("volumes/gather_walk.wgsl", &text)).write("out", zeros).add();
            zeros
        });
        // Slices are what progress counts; each is enough work for all threads.
        let slices = (pixels / (4 * dispatches.lanes)).clamp(1, 16);
        let slice = pixels.div_ceil(slices);
        let done = cx.repeat("", Count::Fixed(slices), &begin, |cx, states| {
            let score = cx.intermediate("score", Shape::uints(SCORE));
            cx.pass("slice", naming(&shader!("volumes/gather_slice")))
                .entry(Entry::Each)
                .grid(Grid::Elements([1, 1, 1]))
                .write_as("score", score, Access::Update, Some(states[1]))
                .param("slice", slice)
                .param("pixels", pixels)
                .add();
            let left = cx.intermediate("left", Shape::Scalar);
            cx.repeat("walks", dispatches.until(left, slice, MOST_STEPS), &[states[0], score, states[2]], |cx, states| {
                let walked = self.walk(cx, &inside, &dispatches, [states[0], states[1], states[2]], size);
                cx.pass("left", naming(&shader!("volumes/gather_left"))).read("score", walked[1], Reach::Whole).write("out", left).add();
                Ok(walked.to_vec())
            })
        })?;
        cx.pass("", shader!("volumes/gather_picture")).read("pixels", done[2], Reach::Whole).write("out", out).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let medium = Extinction::new(cx, &self.medium);
        let emitter = self.light.shape();
        let key = [self.seed ^ cx.seed as u32, (cx.seed >> 32) as u32];
        let mut pixel = 0;
        vec![Tensor::Image(self.camera.view().picture(4, |ray| {
            pixel += 1;
            let walks: Vec<[f64; 2]> = (0..self.paths).map(|path| self.path(&medium, &emitter, ray, key, [pixel, path])).collect();
            let mean = |i: usize| walks.iter().map(|w| w[i]).sum::<f64>() / f64::from(self.paths);
            [mean(0), mean(0), mean(0), mean(1)]
        }))]
    }
}

/// A shader with the names of `gather.wgsl`.
fn naming(shader: &Shader) -> Shader {
    Shader::builtin(&shader.path, &format!("{}\n{}", shader.source, shader!("volumes/gather").source))
}

impl GatherWalk {
    /// One dispatch.
    fn walk(
        &self,
        cx: &mut Lowering<'_>,
        inside: &Inside,
        dispatches: &Dispatches,
        states: [ResourceId; 3],
        size: [u32; 2],
    ) -> [ResourceId; 3] {
        let seed = cx.seed();
        let next = states.map(|id| {
            let shape = cx.shape(id);
            cx.intermediate("walked", shape)
        });
        let pass = inside
            .pass(cx, "walk", &shader!("volumes/gather_walk"), &[shader!("volumes/gather"), shader!("volumes/arrival")])
            .entry(Entry::Each)
            .grid(Grid::Elements([dispatches.lanes, 1, 1]))
            .write_as("lanes", next[0], Access::Update, Some(states[0]))
            .write_as("score", next[1], Access::AtomicUpdate, Some(states[1]))
            .write_as("pixels", next[2], Access::Update, Some(states[2]))
            .constant("LANES", dispatches.lanes as i32)
            .constant("STEPS", dispatches.steps as i32)
            .constant("PATHS", self.paths as i32)
            .constant("MAX_BOUNCES", self.max_bounces as i32)
            .constant("UNIFORM", inside.is_homogeneous())
            .constant("PHASE", self.phase.code())
            .param("majorant", inside.majorant())
            .param("size", size.map(|n| n as i32))
            .param("albedo", self.albedo)
            .param("g", self.phase.g())
            .param("seed_low", self.seed ^ seed as u32)
            .param("seed_high", (seed >> 32) as u32);
        self.camera.describe(self.light.describe(pass)).add();
        next
    }

    /// The radiance that a walk finds, and whether it met the medium.
    fn path(&self, medium: &Extinction<'_>, emitter: &Emitter, ray: Ray, key: [u32; 2], [pixel, path]: [u32; 2]) -> [f64; 2] {
        let mut draws = 0;
        let mut draw = || {
            draws += 1;
            philox([pixel, path, draws, 0], key)
        };
        let Some([enter, _]) = ray.cube_span() else { return [0.0; 2] };
        let (mut place, mut direction) = (ray.at(enter), ray.direction);
        let (mut found, mut throughput, mut bounces) = (0.0, 1.0, 0);
        while bounces < self.max_bounces {
            let words = draw();
            let free = exponential(words[3]) / medium.majorant;
            if free >= to_leave(place, direction) {
                break;
            }
            place += free * direction;
            if !medium.is_homogeneous() && open_unit(words[0]) * medium.majorant >= medium.at(place) {
                continue;
            }
            bounces += 1;
            throughput *= f64::from(self.albedo);
            if let Some(light) = emitter.at(place) {
                let whole = light.distance.min(to_leave(place, light.towards));
                let mut shade = throughput * light.irradiance * self.phase.density(light.towards.dot(direction));
                if medium.is_homogeneous() {
                    shade *= (-medium.majorant * whole).exp();
                } else {
                    let mut left = whole;
                    while shade > 0.0 {
                        left -= exponential(draw()[3]) / medium.majorant;
                        if left <= 0.0 {
                            break;
                        }
                        shade *= 1.0 - medium.at(place + (whole - left) * light.towards) / medium.majorant;
                    }
                }
                found += shade;
            }
            direction = self.phase.scatter(direction, open_unit(words[1]), open_unit(words[2]));
        }
        [found, f64::from(u8::from(bounces > 0))]
    }
}

/// The way from a point of the cube to where it is left.
fn to_leave(origin: DVec3, direction: DVec3) -> f64 {
    Ray { origin, direction }.cube_span().map_or(0.0, |span| span[1])
}
