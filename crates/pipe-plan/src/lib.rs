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
pub mod plan;
mod print;
mod prune;
mod schedule;

use pipe_graph::pass::{Limits, PassGraph};

pub use error::PlanError;
pub use plan::Plan;

/// How to plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Whether passes may be fused.
    pub fuse: bool,
    /// Bytes that may be alive at once; overrides what the device says.
    pub budget: Option<u64>,
    /// Give every value a slot of its own where half of the budget is enough for that, so that what one run made is
    /// still there in the next.
    pub keep: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { fuse: true, budget: None, keep: false }
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
    let (ops, decisions) = if fuse { fuse::fuse(ops, limits) } else { (ops, Vec::new()) };
    if phase == Phase::Fuse {
        let lines: String = decisions.iter().map(|d| format!("{d}\n")).collect();
        return format!("{}\n{lines}", print::ops(&ops));
    }
    print::ops(&schedule::schedule(ops).ops)
}

/// Plans a pass graph for a device.
pub fn plan(name: &str, graph: PassGraph, limits: &Limits, options: &Options) -> Result<Plan, PlanError> {
    let ops = kernel_pass::Ops::new(graph);
    let ops = prune::prune(ops);
    let ops = if options.fuse { fuse::fuse(ops, limits).0 } else { ops };
    let schedule = schedule::schedule(ops);
    allocate::allocate(name, schedule, limits, options)
}
