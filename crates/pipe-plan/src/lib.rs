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

impl Default for Options {
    fn default() -> Self {
        Self { fuse: true, budget: None, tile: None, keep: false }
    }
}

/// A phase whose result `pipe plan --after` shows.
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
            _ => Err(format!("there is no phase `{text}`\n  next: expected lower, prune, fuse or schedule")),
        }
    }
}

/// What there is after a phase, for people.
pub fn after(graph: PassGraph, phase: Phase, fuse: bool, limits: &Limits) -> String {
    let ops = kernel_pass::Ops::new(graph);
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
    let Schedule { ops, portions } = schedule::schedule(narrow::narrow(ops));
    let list = portions.into_iter().flat_map(|p| p.ops().to_vec()).collect();
    print::ops(&kernel_pass::Ops { ops: list, ..ops })
}

/// Plans a pass graph for a device, over whole images.
pub fn plan(name: &str, graph: PassGraph, limits: &Limits, options: &Options) -> Result<Plan, PlanError> {
    let ops = prune::prune(kernel_pass::Ops::new(graph));
    allocate::allocate(name, ordered(ops, limits, options, Thrift::Bytes), limits, options)
}

/// Plans a graph for a device: over whole images where they fit, otherwise with more values computed anew instead of
/// stored, otherwise tile by tile. `wanted` tells by name what is to be fetched.
pub fn plan_graph(graph: &Graph, rim: &Rim, limits: &Limits, options: &Options, wanted: &dyn Fn(&str) -> bool) -> Result<Plan, PlanError> {
    let pruned = |limits: &Limits| {
        let mut passes = lower(graph, rim, limits)?;
        passes.fetches.retain(|f| wanted(&f.name));
        Ok(prune::prune(kernel_pass::Ops::new(passes)))
    };
    let whole = |limits: &Limits, thrift| {
        let schedule = ordered(pruned(limits)?, limits, options, thrift);
        allocate::allocate(&graph.name, schedule, limits, options)
    };
    if let Some(step) = options.tile {
        let limits = Limits { tiled: true, ..*limits };
        return tile::plan_in(&graph.name, ordered(pruned(&limits)?, &limits, options, Thrift::Memory), &limits, options, step);
    }
    let refused = match whole(limits, Thrift::Bytes) {
        Err(error) if error.is_about_size() => error,
        result => return result,
    };
    if let (true, Ok(plan)) = (options.fuse, whole(limits, Thrift::Memory)) {
        return Ok(plan);
    }
    let limits = Limits { tiled: true, ..*limits };
    let schedule = ordered(pruned(&limits)?, &limits, options, Thrift::Memory);
    tile::plan(&graph.name, &schedule, &limits, options).map_err(|why| PlanError::NoTiles { whole: Box::new(refused), why })
}

fn ordered(ops: kernel_pass::Ops, limits: &Limits, options: &Options, thrift: Thrift) -> Schedule {
    let ops = if options.fuse { fuse::fuse(ops, limits, thrift).0 } else { ops };
    schedule::schedule(narrow::narrow(ops))
}
