//! The planner of `pipe`: lower, prune, fuse, schedule, allocate. Pure functions between plain types.
//!
//! ```text
//! Graph ─lower─▶ PassGraph ─prune·fuse─▶ Ops ─schedule─▶ Schedule ─allocate·compose─▶ Plan
//! ```
//!
//! No phase looks at the name of a node; each knows only what passes declare. No phase reads a clock, a hash order
//! or a device: the same graph, sizes and limits give the same plan, byte for byte.

mod allocate;
mod compose;
mod error;
mod fuse;
mod kernel_pass;
pub mod lower;
mod narrow;
pub mod plan;
mod print;
mod prune;
#[cfg(test)]
mod random;
mod schedule;
mod tile;
mod window;

use pipe_graph::graph::Graph;
use pipe_graph::pass::{Limits, PassGraph};

use lower::{Rim, lower};

use fuse::Thrift;
use kernel_pass::Ops;
use schedule::Schedule;

pub use error::PlanError;
pub use plan::Plan;

/// How to plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Whether passes may be fused.
    pub fuse: bool,
    /// Bytes that may be alive at once, beside what the device says.
    pub budget: Option<u64>,
    /// Makes what can be made so in tiles of this size, whether or not it fits whole.
    pub tile: Option<[u32; 2]>,
    /// Give every value a slot of its own where half of the budget is enough for that, so that what one run made is
    /// still there in the next.
    pub keep: bool,
}

impl Options {
    /// Bytes that may be alive at once on a device: the lesser of what the user and the device allow.
    fn budget_on(&self, limits: &Limits) -> Option<u64> {
        self.budget.into_iter().chain(limits.budget).min()
    }
}

impl Default for Options {
    fn default() -> Self {
        Self { fuse: true, budget: None, tile: None, keep: false }
    }
}

/// A phase whose result `pipe plan --after` shows. The last one, `allocate`, leaves the plan itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// What the nodes declared.
    Lower,
    /// Without what nobody needs.
    Prune,
    /// With passes put together, and why others were not.
    Fuse,
    /// In the order in which they will run.
    Schedule,
}

impl std::str::FromStr for Phase {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "lower" => Ok(Self::Lower),
            "prune" => Ok(Self::Prune),
            "fuse" => Ok(Self::Fuse),
            "schedule" => Ok(Self::Schedule),
            _ => Err(format!("there is no phase `{text}`\n  next: expected lower, prune, fuse, schedule or allocate")),
        }
    }
}

/// What there is after a phase, for people.
pub fn after(graph: PassGraph, phase: Phase, fuse: bool, limits: &Limits) -> String {
    let ops = Ops::new(graph);
    if phase == Phase::Lower {
        return print::ops(&ops);
    }
    let ops = prune::prune(ops);
    if phase == Phase::Prune {
        return print::ops(&ops);
    }
    let (ops, decisions) = if fuse { fuse::fuse(ops, limits, Thrift::Bytes) } else { (ops, Vec::new()) };
    if phase == Phase::Fuse {
        let lines: String = decisions.iter().map(|d| format!("{d}\n")).collect();
        return format!("{}\n{lines}", print::ops(&ops));
    }
    let Schedule { ops, portions } = schedule::schedule(ops);
    let list = portions.into_iter().flat_map(|p| p.ops().to_vec()).collect();
    print::ops(&Ops { ops: list, ..ops })
}

/// Plans a pass graph for a device, over whole images.
pub fn plan(name: &str, graph: PassGraph, limits: &Limits, options: &Options) -> Result<Plan, PlanError> {
    whole(name, prune::prune(Ops::new(graph)), limits, options, Thrift::Bytes)
}

/// The plan over whole images. Halves are stored as halves where that takes no more memory in the end: images of different
/// precision cannot share a slot.
fn whole(name: &str, ops: Ops, limits: &Limits, options: &Options, thrift: Thrift) -> Result<Plan, PlanError> {
    let ops = fused(ops, limits, options, thrift);
    let plan = |ops| allocate::allocate(name, schedule::schedule(ops), limits, options);
    let narrowed = narrow::narrow(&ops).map(plan);
    match (plan(ops), narrowed) {
        (Ok(wide), Some(Ok(narrow))) if wide.peak_bytes < narrow.peak_bytes => Ok(wide),
        (_, Some(Ok(narrow))) => Ok(narrow),
        (wide, _) => wide,
    }
}

/// Plans a graph for a device: over whole images where they fit, otherwise with more values computed anew instead of
/// stored, otherwise tile by tile. `wanted` tells by name what is to be fetched.
pub fn plan_graph(graph: &Graph, rim: &Rim, limits: &Limits, options: &Options, wanted: &dyn Fn(&str) -> bool) -> Result<Plan, PlanError> {
    let pruned = |limits: &Limits| {
        let mut passes = lower(graph, rim, limits)?;
        passes.fetches.retain(|f| wanted(&f.name));
        Ok::<Ops, PlanError>(prune::prune(Ops::new(passes)))
    };
    let in_parts = Limits { tiled: true, ..*limits };
    let streamable = || {
        let ops = fused(pruned(&in_parts)?, &in_parts, options, Thrift::Memory);
        Ok::<Schedule, PlanError>(schedule::schedule(narrow::narrow(&ops).unwrap_or(ops)))
    };
    if let Some(step) = options.tile {
        return tile::plan_in(&graph.name, streamable()?, &in_parts, options, step);
    }
    let refused = match whole(&graph.name, pruned(limits)?, limits, options, Thrift::Bytes) {
        Err(error) if error.is_about_size() => error,
        result => return result,
    };
    if options.fuse
        && let Ok(plan) = whole(&graph.name, pruned(limits)?, limits, options, Thrift::Memory)
    {
        return Ok(plan);
    }
    let plan = tile::plan(&graph.name, &streamable()?, &in_parts, options);
    plan.map_err(|why| PlanError::NoTiles { whole: Box::new(refused), why })
}

fn fused(ops: Ops, limits: &Limits, options: &Options, thrift: Thrift) -> Ops {
    if options.fuse { fuse::fuse(ops, limits, thrift).0 } else { ops }
}
