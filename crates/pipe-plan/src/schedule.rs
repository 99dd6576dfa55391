//! A total order of every region that keeps the peak of live bytes low.
//!
//! Exact where it is affordable: the states of a schedule are the sets of operations already done that are closed
//! under dependency, and the bytes alive after such a set do not depend on the order inside it; so the best order is a
//! shortest path over these sets. Up to [`MOST_SETS`] of them are looked at, which covers any chain and most graphs of
//! some twenty passes; beyond, the operation that frees most (or takes least) goes first. Loops are one operation
//! outside and a region of their own inside.

use std::collections::{BTreeMap, BTreeSet};

use pipe_graph::pass::{Origin, ResourceId};

use crate::kernel_pass::{LoopOp, Op, Ops, Portion};

/// Most sets that the exact search looks at in a region of 20 operations; fewer in larger ones.
const MOST_SETS: usize = 4096;

/// Operations in the order in which they will run.
///
/// **Invariant**: every operation stands after those whose results it reads.
#[derive(Debug, Clone)]
pub(crate) struct Schedule {
    /// Resources, names, and what must be there at the end; the operations themselves are in `portions`.
    pub(crate) ops: Ops,
    pub(crate) portions: Vec<Portion>,
}

/// Orders every region.
pub(crate) fn schedule(mut ops: Ops) -> Schedule {
    let wanted: BTreeSet<ResourceId> = ops.wanted().collect();
    let list = std::mem::take(&mut ops.ops);
    let ordered = region(list, &ops, &wanted);
    Schedule { ops, portions: vec![Portion::Whole(ordered)] }
}

fn region(list: Vec<Op>, ops: &Ops, outside: &BTreeSet<ResourceId>) -> Vec<Op> {
    let inner = |l: LoopOp| {
        let wanted: BTreeSet<ResourceId> = l.states.iter().map(|s| s.next).collect();
        LoopOp { body: region(l.body, ops, &wanted), ..l }
    };
    let list: Vec<Op> = list
        .into_iter()
        .map(|op| match op {
            Op::Loop(l) => Op::Loop(inner(l)),
            pass @ Op::Pass(_) => pass,
        })
        .collect();
    let order = Problem::new(&list, ops, outside).solve();
    let mut list: Vec<Option<Op>> = list.into_iter().map(Some).collect();
    order.into_iter().map(|i| list[i].take().expect("an order names each operation once")).collect()
}

/// Who makes and who reads what in one region.
struct Problem {
    /// For each operation: those that must come before it.
    before: Vec<Vec<usize>>,
    /// For each resource of the region: bytes, writer (`None`: there from the start), readers, and whether it stays.
    resources: Vec<Tracked>,
    count: usize,
}

struct Tracked {
    bytes: u64,
    writer: Option<usize>,
    readers: Vec<usize>,
    stays: bool,
}

impl Problem {
    fn new(list: &[Op], ops: &Ops, outside: &BTreeSet<ResourceId>) -> Self {
        let mut tracked: BTreeMap<ResourceId, Tracked> = BTreeMap::new();
        let entry =
            |id: ResourceId| Tracked { bytes: ops.shape(id).bytes(), writer: None, readers: Vec::new(), stays: outside.contains(&id) };
        for (i, op) in list.iter().enumerate() {
            for id in op.results() {
                tracked.entry(id).or_insert_with(|| entry(id)).writer = Some(i);
            }
        }
        for (i, op) in list.iter().enumerate() {
            for id in op.sources() {
                // What comes from outside a body or is a literal stays anyway; an upload is freed after its last reader.
                let uploaded = matches!(ops.resources[id.index()].origin, Origin::External { .. });
                if tracked.contains_key(&id) || uploaded {
                    tracked.entry(id).or_insert_with(|| entry(id)).readers.push(i);
                }
            }
        }
        let mut before = vec![Vec::new(); list.len()];
        for t in tracked.values() {
            if let Some(w) = t.writer {
                for r in &t.readers {
                    before[*r].push(w);
                }
            }
        }
        // A write in the place of another resource must come after every other reader of that resource.
        for (i, op) in list.iter().enumerate() {
            for old in op.takes_over() {
                before[i].extend((0..list.len()).filter(|r| *r != i && list[*r].sources().contains(&old)));
            }
        }
        Self { before, resources: tracked.into_values().collect(), count: list.len() }
    }

    /// Bytes alive while `op` runs after `done`, and after it.
    fn bytes(&self, done: &[bool], op: usize) -> (u64, u64) {
        let (mut during, mut after) = (0, 0);
        for t in &self.resources {
            let made = t.writer.is_none_or(|w| done[w]);
            let now = made && (t.stays || t.readers.iter().any(|r| !done[*r]));
            let written = t.writer == Some(op);
            if now || written {
                during += t.bytes;
            }
            let later = t.stays || t.readers.iter().any(|r| !done[*r] && *r != op);
            if (made || written) && later {
                after += t.bytes;
            }
        }
        (during, after)
    }

    fn ready(&self, done: &[bool]) -> Vec<usize> {
        (0..self.count).filter(|i| !done[*i] && self.before[*i].iter().all(|b| done[*b])).collect()
    }

    fn solve(&self) -> Vec<usize> {
        self.exact().unwrap_or_else(|| self.greedy())
    }

    fn greedy(&self) -> Vec<usize> {
        let mut done = vec![false; self.count];
        let mut order = Vec::with_capacity(self.count);
        while order.len() < self.count {
            let ready = self.ready(&done);
            let best = if let [only] = ready[..] {
                only
            } else {
                ready.into_iter().min_by_key(|i| (self.bytes(&done, *i).1, *i)).expect("regions are acyclic")
            };
            done[best] = true;
            order.push(best);
        }
        order
    }

    /// Level by level over closed sets: for each the lowest peak of any order that leads to it, and its last step.
    fn exact(&self) -> Option<Vec<usize>> {
        type Set = Vec<bool>;
        let mut levels: Vec<BTreeMap<Set, (u64, usize)>> = vec![BTreeMap::from([(vec![false; self.count], (0, usize::MAX))])];
        let mut seen = 1;
        for _ in 0..self.count {
            let mut next: BTreeMap<Set, (u64, usize)> = BTreeMap::new();
            for (set, (peak, _)) in levels.last().expect("begins with one") {
                for op in self.ready(set) {
                    let peak = (*peak).max(self.bytes(set, op).0);
                    let mut grown = set.clone();
                    grown[op] = true;
                    let known = next.entry(grown).or_insert((u64::MAX, op));
                    if (peak, op) < *known {
                        *known = (peak, op);
                    }
                }
            }
            seen += next.len();
            if seen * self.count > MOST_SETS * 20 {
                return None;
            }
            levels.push(next);
        }
        let mut set = vec![true; self.count];
        let mut order = Vec::with_capacity(self.count);
        for level in levels[1..].iter().rev() {
            let (_, op) = level.get(&set)?;
            order.push(*op);
            set[*op] = false;
        }
        order.reverse();
        Some(order)
    }
}
