//! Drops what nobody needs: passes whose results are neither fetched, kept nor read, and states that nothing reads.

use std::collections::BTreeSet;

use pipe_graph::pass::{Count, ResourceId};

use crate::kernel_pass::{LoopOp, Op, Ops};

/// Drops unneeded operations, bodies of loops included.
pub(crate) fn prune(mut ops: Ops) -> Ops {
    let mut needed: BTreeSet<ResourceId> = ops.wanted().collect();
    ops.ops = region(ops.ops, &mut needed);
    ops
}

/// Backwards, so that every reader was seen before its writer.
fn region(ops: Vec<Op>, needed: &mut BTreeSet<ResourceId>) -> Vec<Op> {
    let mut kept = Vec::with_capacity(ops.len());
    for op in ops.into_iter().rev() {
        if !op.results().iter().any(|r| needed.contains(r)) {
            continue;
        }
        let op = match op {
            Op::Loop(l) => Op::Loop(prune_loop(l, needed)),
            pass @ Op::Pass(_) => pass,
        };
        needed.extend(op.sources());
        kept.push(op);
    }
    kept.reverse();
    kept
}

/// A state is needed when its result is, or when the body needs it to make another one that is.
fn prune_loop(mut l: LoopOp, needed: &BTreeSet<ResourceId>) -> LoopOp {
    let mut alive: Vec<bool> = l.states.iter().map(|s| needed.contains(&s.result)).collect();
    loop {
        let mut inside: BTreeSet<ResourceId> = BTreeSet::new();
        if let Count::Until { value, .. } = l.count {
            inside.insert(value);
        }
        inside.extend(l.states.iter().zip(&alive).filter(|(_, a)| **a).map(|(s, _)| s.next));
        let body = region(l.body.clone(), &mut inside);
        let more: Vec<bool> = l.states.iter().zip(&alive).map(|(s, a)| *a || inside.contains(&s.carried)).collect();
        if more == alive {
            let mut flags = alive.into_iter();
            l.states.retain(|_| flags.next().unwrap_or(true));
            l.body = body;
            return l;
        }
        alive = more;
    }
}
