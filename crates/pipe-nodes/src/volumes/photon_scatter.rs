//! `PhotonScatter`: Monte Carlo transport of light through a medium.
//!
//! A batch of photons is walked by as many threads as a device keeps busy. A thread walks a photon for some steps in one
//! dispatch and goes on in the next, from state kept in the table `lanes`; whose photon has ended takes the next one of
//! the batch. Dispatches repeat until all have ended: no dispatch is long, however long a photon lives.
//!
//! Everything is counted in integers of two words, by atomic additions to the table `score`, so that sums depend neither
//! on the order of photons nor on how they are dealt out. After each batch the score is added to `tallies`, with the
//! squares that the standard error is made of; `tallies` is also what a later run goes on from.
//!
//! Rejected: one dispatch for each bounce of all photons (state travels through memory at every step, and the last
//! photons are walked alone); floats added by compare-and-swap (no run would give the same bits twice); Russian roulette
//! that raises the weight of survivors (unbiased too, but energy is kept only on average).

use pipe_graph::node::scalar;
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::dispatches::Dispatches;
use super::light::Light;
use super::medium::{self, Extinction, Inside, Medium};
use super::phase::Phase;
use super::photon_twin::{Generator, Walk};
use super::resolution::Resolution;
use crate::shader;

/// Sends photons into the unit cube and follows each until it is absorbed or leaves. At a collision a photon of weight w
/// leaves (1 − albedo)·w behind and is scattered with the rest; once its weight is at most `min_energy` it is absorbed as a
/// whole with probability 1 − albedo instead (roulette that changes no mean and keeps energy). So absorbed + escaped +
/// alive = 1, whatever the number of photons.
///
/// The same seed gives the same bits on one device. Photons are numbered, and each has random numbers of its own
/// (Philox 4×32-7, keyed by seed and photon): neither batches nor continuing a result change what a photon does.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct PhotonScatter {
    /// What light travels through: `Homogeneous(sigma_t)`, a Volume of σt, `Scaled(volume, sigma_t)` or
    /// `CloudChamber(density_scale)`.
    #[default(medium::homogeneous())]
    medium: Medium,
    /// Voxels of the results: a number, or [x, y, z].
    #[schemars(range(min = 1))]
    resolution: Resolution,
    /// How many photons.
    #[default = 1_000_000]
    #[schemars(range(min = 1, max = 4_000_000_000_u32))]
    photons: u32,
    /// Share of the light that a collision scatters.
    #[default = 0.9]
    #[schemars(range(min = 0.0, max = 1.0))]
    albedo: f32,
    /// Where light goes when it is scattered.
    phase: Phase,
    /// Where photons begin: `Point([x, y, z])`, `Beam(origin, direction)` or `Plane(origin, normal, size)`, `size` a side or
    /// both. From outside of the cube they travel straight to it; those that miss it have escaped.
    light: Light,
    /// Weight from which on a photon is absorbed as a whole or not at all; 0: never.
    #[default = 0.001]
    #[schemars(range(min = 0.0, max = 1.0))]
    min_energy: f32,
    /// What happens at the faces of the cube.
    boundary: Boundary,
    /// Length of the pieces of a marched ray; they also end at faces, and with `TrackLength` at faces of voxels.
    #[default = 0.00390625]
    #[schemars(range(min = 1e-4, max = 1.0))]
    step: f32,
    /// What estimates the fluence.
    estimator: Estimator,
    /// How free paths are found in a medium that varies; in a homogeneous one they are exact.
    tracking: Tracking,
    /// Another seed, other photons.
    seed: u32,
    /// Where random numbers come from.
    random: Random,
    /// How many batches photons are dealt out to: what the standard error is estimated from, and what progress counts.
    #[default = 16]
    #[schemars(range(min = 1, max = 65536))]
    batches: u32,
    /// `tallies` of an earlier PhotonScatter of the same resolution: its photons count too, and the new ones are numbered
    /// behind them.
    earlier: Option<In<Table>>,
}

/// What happens at the faces of the cube.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub(super) enum Boundary {
    /// Light leaves.
    #[default]
    Absorb,
    /// An infinite slab: light leaves through the faces −y and +y; what goes out along x and z comes in on the other side.
    PeriodicXZ,
}

/// What estimates the fluence in a voxel.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub(super) enum Estimator {
    /// Collisions, each for 1/σt: nothing is known where σt = 0.
    #[default]
    Collision,
    /// Lengths of the paths through it.
    TrackLength,
}

/// How free paths are found.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub(super) enum Tracking {
    /// σt along the ray is added up in pieces of length `step`, each with the σt at its middle.
    #[default]
    March,
    /// Collisions are drawn by the largest σt of the medium and accepted by σt there (E. Woodcock et al. 1965): exact.
    Delta,
}

/// Where random numbers come from.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub(super) enum Random {
    /// Philox 4×32-7: a hash of seed, photon and a counter.
    #[default]
    Counter,
    /// A hybrid Tausworthe generator of four words for each photon, begun from seed and photon.
    Tausworthe,
}

pub(super) const KIND: Kind = Kind::of::<PhotonScatter>(
    "PhotonScatter",
    Category::Volumes,
    &[
        r#"PhotonScatter(medium: Homogeneous(3), resolution: 4, photons: 150, light: Point([0.5, 0.5, 0.5]), batches: 4)"#,
        r#"PhotonScatter(medium: Homogeneous(2), resolution: [2, 5, 3], photons: 120, phase: HenyeyGreenstein(0.75), boundary: PeriodicXZ, light: Plane([0.5, 1, 0.5], [0, -1, 0], 1), estimator: TrackLength, seed: 3)"#,
        r#"PhotonScatter(medium: "fog", resolution: 4, photons: 100, phase: Rayleigh, light: Beam([-0.2, 0.4, 0.3], [1, 0.1, 0.2]), tracking: Delta)"#,
        r#"PhotonScatter(medium: CloudChamber, resolution: 4, photons: 60, tracking: Delta, random: Tausworthe, min_energy: 0.5)"#,
        r#"PhotonScatter(medium: Scaled("fog", 2), resolution: 3, photons: 60, albedo: 0.5, step: 0.02, estimator: TrackLength, random: Tausworthe)"#,
    ],
)
.ports(&[
    ("fluence", "power through a small sphere by the area of its cross-section, in each voxel, for a light of power 1"),
    ("deposited", "the share of the light that is absorbed in each voxel"),
    ("absorbed", "the share that is absorbed, a Scalar"),
    ("escaped", "the share that leaves the cube, a Scalar"),
    ("faces", "the share that leaves through each face, −x, +x, −y, +y, −z, +z: a Table; unscattered light included"),
    ("alive", "the share of photons given up after 2²⁴ steps, a Scalar: 0 unless light goes round for ever"),
    ("error", "standard error of the fluence in each voxel, from the differences between batches; the fluence if there is one only"),
    ("tallies", "all counts, a Table of u32: what `earlier` takes"),
])
// The twin walks the same photons. Positions differ by rounding, so a photon in many millions is counted in a neighbouring
// voxel; sums of so few photons are otherwise alike to six digits. Counts are integers of up to nine digits.
.tolerance(2e-3, 2e-4);

/// Words of `tallies` and `score` before the voxels, and where they stand: see `photon.wgsl`.
const VOXELS: u32 = 20;

/// Up to so many voxels in all there are several sets of them.
const MOST_BANKED: u32 = 16384;

/// Words that a lane keeps.
const LANE: u32 = 15;

/// More steps than any photon should take, as in `photon_scatter.wgsl`.
const MOST_STEPS: u64 = 1 << 24;

impl Node for PhotonScatter {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        medium::check(&self.medium)?;
        self.phase.check()?;
        self.light.check()?;
        if self.resolution.size().map(u64::from).iter().product::<u64>() > 1 << 27 {
            return Err(Mistake::in_field("resolution", "has more than 2²⁷ voxels").hint("512 along each axis is the most"));
        }
        Ok(())
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let volume = self.resolution.volume(1)?;
        let tallies = TableType { len: self.tallies_len(), element: Element::U32 };
        if let Some(earlier) = &self.earlier
            && inputs.table(earlier) != tallies
        {
            let got = EdgeType::Table(inputs.table(earlier));
            return Err(Mistake::in_field("earlier", format!("is a {got}, not a {}", EdgeType::Table(tallies)))
                .hint("expected the port `tallies` of a PhotonScatter of the same resolution"));
        }
        Ok(vec![
            Output::new("fluence", volume),
            Output::new("deposited", volume),
            Output::new("absorbed", scalar(1)),
            Output::new("escaped", scalar(1)),
            Output::new("faces", EdgeType::table(6, Element::F32)),
            Output::new("alive", scalar(1)),
            Output::new("error", volume),
            Output::new("tallies", EdgeType::Table(tallies)),
        ])
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let inside = Inside::new(cx, &self.medium);
        let batches = self.batches.min(self.photons);
        let start = self.start(cx);
        let tallies = cx.repeat("", Count::Fixed(batches), &[start], |cx, states| Ok(vec![self.batch(cx, &inside, states[0])?]))?[0];
        cx.emit("tallies", tallies);
        for (what, port) in ["fluence", "error", "deposited"].into_iter().enumerate() {
            let out = cx.output(port);
            cx.pass(port, counting(&shader!("volumes/photon_volume"), ""))
                .read("tallies", tallies, Reach::Whole)
                .write("out", out)
                .constant("WHAT", what as i32)
                .constant("TRACK", self.estimator == Estimator::TrackLength)
                .param("majorant", inside.majorant())
                .add();
        }
        let absorbed = self.absorbed(cx, tallies);
        let share = shader!("volumes/photon_share");
        for (port, text, read) in [
            ("faces", "fn at(i: i32) -> f32 { return share(FACES + 2 * i); }", tallies),
            ("alive", "fn at(i: i32) -> vec4f { return vec4f(share(ALIVE)); }", tallies),
            ("absorbed", "fn at(i: i32) -> vec4f { return vec4f(share_of(vec2u(load_total(0), load_total(1)))); }", absorbed),
            (
                "escaped",
                "fn at(i: i32) -> vec4f {\n\
                 \x20   return vec4f(share(FACES) + share(FACES + 2) + share(FACES + 4) + share(FACES + 6) + share(FACES + 8) + share(FACES + 10));\n}",
                tallies,
            ),
        ] {
            let out = cx.output(port);
            let pass = cx.pass(port, counting(&share, text)).read("tallies", tallies, Reach::Whole);
            if read == tallies { pass } else { pass.read("total", read, Reach::Whole) }.write("out", out).add();
        }
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let earlier: Vec<f64> = self.earlier.as_ref().map(|port| cx.table(port).to_vec()).unwrap_or_default();
        let medium = Extinction::new(cx, &self.medium);
        let walk = Walk {
            medium: &medium,
            size: self.resolution.size(),
            emitter: self.light.shape(),
            phase: self.phase,
            albedo: f64::from(self.albedo),
            min_energy: f64::from(self.min_energy),
            periodic: self.boundary == Boundary::PeriodicXZ,
            marched: (self.marches(&medium)).then_some(f64::from(self.step)),
            counts_paths: self.estimator == Estimator::TrackLength,
            generator: Generator {
                key: [self.seed ^ cx.seed as u32, (cx.seed >> 32) as u32],
                tausworthe: self.random == Random::Tausworthe,
            },
        };
        walk.run(&earlier, self.photons, self.batches.min(self.photons)).tensors(&walk)
    }
}

/// A shader with the names of `photon.wgsl`, and this ending.
fn counting(shader: &Shader, ending: &str) -> Shader {
    Shader::builtin(&shader.path, &format!("{}\n{}\n{ending}\n", shader.source, shader!("volumes/photon").source))
}

impl PhotonScatter {
    fn voxels(&self) -> u32 {
        self.resolution.size().iter().product()
    }

    /// Sets of voxels that threads count in: several where voxels are few.
    fn banks(&self) -> u32 {
        (MOST_BANKED / self.voxels()).clamp(1, 64)
    }

    fn score_len(&self) -> u32 {
        VOXELS + 4 * self.voxels() * self.banks()
    }

    fn tallies_len(&self) -> u32 {
        VOXELS + 5 * self.voxels()
    }

    fn marches(&self, medium: &Extinction<'_>) -> bool {
        self.tracking == Tracking::March && !medium.is_homogeneous()
    }

    /// The counts before the first batch.
    fn start(&self, cx: &mut Lowering<'_>) -> ResourceId {
        let earlier = match &self.earlier {
            Some(port) => cx.input(port),
            None => cx.uints("nothing", &[0]),
        };
        let start = cx.intermediate("start", Shape::uints(self.tallies_len()));
        cx.pass("start", counting(&shader!("volumes/photon_start"), ""))
            .read("earlier", earlier, Reach::Whole)
            .write("out", start)
            .param("photons", self.photons)
            .add();
        start
    }

    /// A batch of photons; answers the counts with it.
    fn batch(&self, cx: &mut Lowering<'_>, inside: &Inside, tallies: ResourceId) -> Result<ResourceId, Mistake> {
        let batch = self.photons.div_ceil(self.batches.min(self.photons));
        let dispatches = Dispatches::new(cx.limits().profile, batch);
        let lanes = cx.intermediate("lanes", Shape::uints(LANE * dispatches.lanes));
        let score = cx.intermediate("score", Shape::uints(self.score_len()));
        cx.pass("batch", counting(&shader!("volumes/photon_batch"), ""))
            .entry(Entry::Each)
            .grid(Grid::Elements([(LANE * dispatches.lanes).max(self.score_len()), 1, 1]))
            .read("tallies", tallies, Reach::Whole)
            .write("lanes", lanes)
            .write("score", score)
            .param("batch", batch)
            .add();
        let left = cx.intermediate("left", Shape::Scalar);
        let count = dispatches.until(left, batch, MOST_STEPS);
        let walked = cx.repeat("walks", count, &[lanes, score], |cx, states| {
            let walked = self.walk(cx, inside, &dispatches, [states[0], states[1]]);
            cx.pass("left", counting(&shader!("volumes/photon_left"), "")).read("score", walked[1], Reach::Whole).write("out", left).add();
            Ok(walked.to_vec())
        })?;
        let next = cx.intermediate("tallies", Shape::uints(self.tallies_len()));
        cx.pass("fold", counting(&shader!("volumes/photon_fold"), ""))
            .entry(Entry::Each)
            .grid(Grid::Elements([self.voxels() + 1, 1, 1]))
            .read("score", walked[1], Reach::Whole)
            .write_as("tallies", next, Access::Update, Some(tallies))
            .constant("BANKS", self.banks() as i32)
            .param("voxels", self.voxels() as i32)
            .add();
        Ok(next)
    }

    /// One dispatch.
    fn walk(&self, cx: &mut Lowering<'_>, inside: &Inside, dispatches: &Dispatches, [lanes, score]: [ResourceId; 2]) -> [ResourceId; 2] {
        let seed = cx.seed();
        let walked = [lanes, score].map(|id| {
            let shape = cx.shape(id);
            cx.intermediate("walked", shape)
        });
        let varies = !inside.is_homogeneous();
        let parts = [shader!("volumes/photon"), shader!("volumes/light")];
        let pass = inside
            .pass(cx, "walk", &shader!("volumes/photon_scatter"), &parts)
            .entry(Entry::Each)
            .grid(Grid::Elements([dispatches.lanes, 1, 1]))
            .write_as("lanes", walked[0], Access::Update, Some(lanes))
            .write_as("score", walked[1], Access::AtomicUpdate, Some(score))
            .constant("LANES", dispatches.lanes as i32)
            .constant("BANKS", self.banks() as i32)
            .constant("STEPS", dispatches.steps as i32)
            .constant("PERIODIC", self.boundary == Boundary::PeriodicXZ)
            .constant("TRACK", self.estimator == Estimator::TrackLength)
            .constant("MARCH", varies && self.tracking == Tracking::March)
            .constant("DELTA", varies && self.tracking == Tracking::Delta)
            .constant("TAUSWORTHE", self.random == Random::Tausworthe)
            .constant("PHASE", self.phase.code())
            .param("resolution", self.resolution.size().map(|n| n as i32))
            .param("majorant", inside.majorant())
            .param("step", self.step)
            .param("albedo", self.albedo)
            .param("min_energy", self.min_energy)
            .param("g", self.phase.g())
            .param("seed_low", self.seed ^ seed as u32)
            .param("seed_high", (seed >> 32) as u32);
        self.light.describe(pass).add();
        walked
    }

    /// The sum of all deposits, as two words.
    fn absorbed(&self, cx: &mut Lowering<'_>, tallies: ResourceId) -> ResourceId {
        let shader = shader!("volumes/photon_deposits");
        let text =
            "fn each(i: i32) {\n    let total = strided_total(i);\n    store_out(2 * i, total.x);\n    store_out(2 * i + 1, total.y);\n}";
        let (mut terms, mut count, mut first, mut apart) = (tallies, self.voxels(), VOXELS + 2, 4);
        loop {
            let stride = count.div_ceil(64);
            let totals = cx.intermediate("deposits", Shape::uints(2 * stride));
            cx.pass("deposits", Shader::builtin(&shader.path, &format!("{}\n{text}\n", shader.source)))
                .entry(Entry::Each)
                .grid(Grid::Elements([stride, 1, 1]))
                .read("terms", terms, Reach::Whole)
                .write("out", totals)
                .param("first", first as i32)
                .param("apart", apart)
                .param("count", count as i32)
                .param("stride", stride as i32)
                .add();
            if stride == 1 {
                return totals;
            }
            (terms, count, first, apart) = (totals, stride, 0, 2);
        }
    }
}
