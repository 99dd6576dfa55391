//! Images that do not fit: passes are run tile by tile.
//!
//! A resource is *streamed* when only a window of it need be held at a time: an image, or pixels of a file, that is made
//! pixel by pixel (or block by block) and that everybody looks at within a bounded reach. Everything else (tables,
//! scalars, volumes, images that somebody reads from anywhere) is held whole.
//!
//! What a reduction leaves in a table is known once all tiles have passed; so passes have *levels*: one that needs such
//! a table, directly or not, is a level above the reduction. Each level that ends in something held whole, or in pixels
//! for the host, becomes one [`TilingOp`], with everything streamed that it needs, back to the files; what two levels
//! need is computed in both. So the statistics of an image and what is made of them take two rounds over its tiles, and
//! no image is ever held.
//!
//! How wide a window is follows from reaches, from the last pass back to the first. A loop over streamed states runs
//! whole inside a tile, on windows that are wider by the reach of all its iterations.

mod cut;
mod look;
mod streams;

use pipe_graph::pass::{Limits, Shape};

use self::look::{Look, look, loop_reach};
use self::streams::Streams;
use crate::error::human;
use crate::kernel_pass::{Brought, Op, Ops, Portion, TilingOp};
use crate::schedule::Schedule;
use crate::{Options, Plan, PlanError};

/// Pixels that may be computed for each that is wanted: beyond, more than half of the work is wasted on halos.
const MOST_WORK: f32 = 2.0;

/// Overlap that is not worth smaller tiles or shorter rows of pixels.
const LITTLE_WORK: f32 = 1.25;

/// Width and height below which tiles are not halved.
const LEAST: u32 = 16;

/// Bytes of pixels that the host should hold of a row of tiles.
const HOST_BYTES: u64 = 256 << 20;

/// The best plan over tiles: the largest that fit, and of those that overlap much, those that overlap least. Answers why
/// there is none.
pub(crate) fn plan(name: &str, schedule: &Schedule, limits: &Limits, options: &Options) -> Result<Plan, String> {
    let streams = Streams::of(schedule);
    if !streams.any() {
        return Err(streams.culprit(&schedule.ops).unwrap_or_else(|| "no pass of it works on a part of an image alone".to_owned()));
    }
    let mut sizes = streams.candidates(&schedule.ops, limits, options);
    sizes.sort_by(|a, b| {
        let cost = |c: &Candidate| if c.work <= LITTLE_WORK { 0.0 } else { c.work };
        let area = |c: &Candidate| u64::from(c.step[0]) * u64::from(c.step[1]);
        cost(a).total_cmp(&cost(b)).then(area(b).cmp(&area(a))).then(b.step.cmp(&a.step))
    });
    let mut reason = None;
    for candidate in &sizes {
        if candidate.work > MOST_WORK {
            let [w, h] = candidate.step;
            reason = Some(format!(
                "tiles of {w}x{h} would compute {:.1} times the pixels that are wanted, since passes look so far around{}",
                candidate.work,
                streams.farthest(&schedule.ops)
            ));
            break;
        }
        match crate::allocate::allocate(name, streams.cut(schedule.ops.clone(), candidate.step), limits, options) {
            Ok(plan) => return Ok(plan),
            Err(error) if error.is_about_size() => {
                let [w, h] = candidate.step;
                reason = Some(format!("with tiles of {w}x{h}, {}", error.reason()));
            }
            Err(error) => return Err(error.to_string()),
        }
    }
    Err(streams.culprit(&schedule.ops).or(reason).unwrap_or_else(|| streams.widest(&schedule.ops)))
}

/// The plan over tiles of this size; over whole images where nothing can be made in tiles.
pub(crate) fn plan_in(name: &str, schedule: Schedule, limits: &Limits, options: &Options, step: [u32; 2]) -> Result<Plan, PlanError> {
    crate::allocate::allocate(name, cut_in(schedule, step), limits, options)
}

/// The schedule over tiles of this size; as it is where nothing can be made in tiles.
pub(crate) fn cut_in(schedule: Schedule, step: [u32; 2]) -> Schedule {
    let streams = Streams::of(&schedule);
    if streams.any() { streams.cut(schedule.ops, step.map(|n| n.max(1))) } else { schedule }
}

/// A size of tiles.
struct Candidate {
    step: [u32; 2],
    work: f32,
}

impl Streams {
    /// The largest image that is held whole, and why.
    fn culprit(&self, ops: &Ops) -> Option<String> {
        let largest = self.held.iter().max_by_key(|h| ops.shape(h.id).bytes())?;
        let resource = &ops.resources[largest.id.index()];
        Some(format!("`{}` needs {} whole, since {}", resource.name, human(&resource.shape.bytes()), largest.why))
    }

    /// What the smallest tiles need most of.
    fn widest(&self, ops: &Ops) -> String {
        let schedule = self.cut(ops.clone(), [LEAST; 2]);
        let tilings = schedule.portions.iter().filter_map(Portion::tiling);
        let held = tilings.flat_map(|t| t.windows.views.keys()).map(|id| &schedule.ops.resources[id.index()]);
        let widest = held.max_by_key(|r| r.shape.bytes());
        widest.map_or_else(String::new, |r| {
            format!(
                "even for tiles of {LEAST}x{LEAST} `{}` takes {}, since passes look so far around{}",
                r.name,
                human(&r.shape.bytes()),
                self.farthest(ops)
            )
        })
    }

    /// Who looks farthest around a pixel, as the end of a sentence.
    fn farthest(&self, ops: &Ops) -> String {
        let far = |op: &Op| match op {
            Op::Pass(pass) => {
                let looks = (0..pass.reads.len()).filter_map(|read| match look(pass, read) {
                    Look::Around(reach) | Look::Block(reach) => Some(reach),
                    _ => None,
                });
                (looks.flatten().max().unwrap_or(0), pass.nodes.last().copied())
            }
            Op::Loop(l) => (loop_reach(l).map_or(0, |halo| halo.before[0].max(halo.before[1])), Some(l.node)),
        };
        match self.list.iter().map(far).max_by_key(|(far, _)| *far) {
            Some((far @ 1.., Some(node))) => format!(": `{}` most, {far} pixels", ops.nodes[node.0 as usize]),
            _ => String::new(),
        }
    }

    /// Sizes of tiles that may fit, halved again and again from the whole image; how much they overlap.
    fn candidates(&self, ops: &Ops, limits: &Limits, options: &Options) -> Vec<Candidate> {
        let budget = options.budget_on(limits).unwrap_or(u64::MAX);
        let sizes = self.streamed.iter().filter_map(|id| ops.shape(*id).plane());
        let size = sizes.fold([1, 1], |a, b| [a[0].max(b[0]), a[1].max(b[1])]);
        let halved = |n: u32| {
            let below = (0..32).rev().map(|k| 1_u32 << k).filter(move |p| *p < n && *p >= LEAST.min(n));
            std::iter::once(n).chain(below).collect::<Vec<_>>()
        };
        let mut found = Vec::new();
        for w in halved(size[0]) {
            for h in halved(size[1]) {
                let schedule = self.cut(ops.clone(), [w, h]);
                let tilings: Vec<&TilingOp> = schedule.portions.iter().filter_map(Portion::tiling).collect();
                let held = || tilings.iter().flat_map(|t| t.windows.views.keys());
                let most = limits.max_piece.min(budget);
                let fits = held().all(|id| match schedule.ops.shape(*id) {
                    Shape::Image(t) => t.size.iter().all(|n| *n <= limits.max_image) && schedule.ops.shape(*id).bytes() <= most,
                    shape => shape.bytes() <= limits.max_binding_bytes.min(most),
                });
                // What the host holds of a row of tiles, however it is cut along x.
                let host = tilings.iter().map(|t| {
                    let row = |b: &Brought| {
                        let (shape, width) = (schedule.ops.shape(b.resource), t.windows.size_of(b.resource)[0]);
                        shape.bytes() / u64::from(shape.plane().map_or(1, |held| held[0])) * u64::from(width)
                    };
                    t.uploads.iter().chain(&t.fetches).map(row).sum::<u64>()
                });
                let work = tilings.iter().map(|t| t.work).fold(1.0, f32::max);
                if fits && (host.max().unwrap_or(0) <= HOST_BYTES || h <= LEAST) {
                    found.push(Candidate { step: [w, h], work });
                }
            }
        }
        found
    }
}
