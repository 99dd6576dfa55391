//! The least storage that loses nothing: images whose values are all half floats are stored as such.
//!
//! Halves come from files of halves, and stay halves where passes only move or choose among them. What must stay, or is
//! the state of a loop, keeps the storage that others expect of it.

use std::collections::BTreeSet;

use pipe_graph::pass::{ResourceId, Shape, Values};
use pipe_graph::types::Precision;

use crate::kernel_pass::{KernelPass, Op, Ops, Source};

/// The same with images of halves stored as halves; `None` where there are none.
pub(crate) fn narrow(ops: &Ops) -> Option<Ops> {
    let mut fixed: BTreeSet<ResourceId> = ops.wanted().collect();
    for op in &ops.ops {
        // A write in the place of another has that one's storage.
        fixed.extend(op.takes_over());
        if let Op::Loop(l) = op {
            fixed.extend(l.states.iter().flat_map(|s| [s.init, s.carried, s.next, s.result]));
        }
    }
    let mut halves: BTreeSet<ResourceId> = BTreeSet::new();
    for op in &ops.ops {
        let Op::Pass(pass) = op else { continue };
        for write in pass.writes.iter().filter(|w| w.in_place_of.is_none() && !fixed.contains(&w.resource)) {
            if matches!(ops.shape(write.resource), Shape::Image(_)) && makes_halves(pass, write.stage, &halves) {
                halves.insert(write.resource);
            }
        }
    }
    let wide = |id: &ResourceId| matches!(ops.shape(*id), Shape::Image(t) if t.precision == Precision::F32);
    if !halves.iter().any(wide) {
        return None;
    }
    let mut ops = ops.clone();
    for id in halves {
        if let Shape::Image(t) = &mut ops.resources[id.index()].shape {
            t.precision = Precision::F16;
        }
    }
    Some(ops)
}

fn makes_halves(pass: &KernelPass, stage: usize, halves: &BTreeSet<ResourceId>) -> bool {
    let images = || pass.stages[stage].ports.iter().filter(|p| matches!(p.shape, Shape::Image(_)));
    match pass.stages[stage].values {
        Values::Any => false,
        Values::Halves => true,
        Values::Read => images().all(|port| match port.source {
            Source::Read(r) => halves.contains(&pass.reads[r]) || matches!(port.shape, Shape::Image(t) if t.precision == Precision::F16),
            Source::Stage(k) => makes_halves(pass, k, halves),
        }),
    }
}
