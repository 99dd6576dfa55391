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
}

impl Default for Options {
    fn default() -> Self {
        Self { fuse: true, budget: None }
    }
}

/// Plans a pass graph for a device.
pub fn plan(name: &str, graph: PassGraph, limits: &Limits, options: &Options) -> Result<Plan, PlanError> {
    let ops = kernel_pass::Ops::new(graph);
    let ops = prune::prune(ops);
    let schedule = schedule::schedule(ops);
    allocate::allocate(name, schedule, limits, options)
}
