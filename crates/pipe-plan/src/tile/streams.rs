//! What is streamed, what is held whole and why, and in which rounds over the tiles everything runs.

use std::collections::{BTreeMap, BTreeSet};

use pipe_graph::pass::{Entry, Origin, ResourceId};

use super::look::{Look, look, loop_own, loop_reach, tileable};
use crate::kernel_pass::{KernelPass, LoopOp, Op, Ops};
use crate::schedule::Schedule;

/// Why tiles cannot be made: what must be held whole, and its reader.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Held {
    pub(super) id: ResourceId,
    pub(super) why: String,
}

/// One way through all tiles.
#[derive(Debug, Clone)]
pub(super) struct Round {
    pub(super) level: u32,
    /// The operations that leave something whole, or that the host takes from, by position.
    pub(super) ends: Vec<usize>,
    /// Everything that runs, by position, in order.
    pub(super) body: Vec<usize>,
}

/// What is streamed, and in which round each operation runs.
pub(super) struct Streams {
    pub(super) list: Vec<Op>,
    pub(super) streamed: BTreeSet<ResourceId>,
    /// By position in `list`.
    pub(super) levels: Vec<u32>,
    pub(super) makers: BTreeMap<ResourceId, usize>,
    pub(super) rounds: Vec<Round>,
    /// What is held whole although it is an image, with the reason.
    pub(super) held: Vec<Held>,
}

impl Streams {
    /// Finds what can be streamed.
    pub(super) fn of(schedule: &Schedule) -> Self {
        let ops = &schedule.ops;
        let list: Vec<Op> = schedule.portions.iter().flat_map(|p| p.ops().iter().cloned()).collect();
        let mut excluded: Vec<Held> = Vec::new();
        loop {
            let (streamed, held) = streamed(&list, ops, &excluded);
            let levels = levels(&list, &streamed);
            let makers = list.iter().enumerate().flat_map(|(i, op)| op.results().into_iter().map(move |id| (id, i))).collect();
            let mut this = Self { list: list.clone(), streamed, levels, makers, rounds: Vec::new(), held };
            this.rounds = this.find_rounds(ops);
            match this.torn(ops) {
                None => return this,
                Some(held) => excluded.push(held),
            }
        }
    }

    /// Whether there is anything to stream.
    pub(super) fn any(&self) -> bool {
        !self.streamed.is_empty()
    }

    pub(super) fn is_streamed(&self, op: &Op) -> bool {
        op.sources().iter().chain(&op.results()).any(|id| self.streamed.contains(id))
    }

    /// Whether the operation leaves something that is held whole, or that the host takes.
    fn is_end(&self, op: &Op, ops: &Ops) -> bool {
        self.is_streamed(op) && op.results().iter().any(|id| !self.streamed.contains(id) || ops.wanted().any(|w| w == *id))
    }

    /// The operations that a round ending in `ends` runs, in order.
    fn closure(&self, ends: &[usize]) -> Vec<usize> {
        let mut taken: BTreeSet<usize> = ends.iter().copied().collect();
        let mut open: Vec<usize> = ends.to_vec();
        while let Some(at) = open.pop() {
            for id in self.list[at].sources().into_iter().filter(|id| self.streamed.contains(id)) {
                if let Some(maker) = self.makers.get(&id).filter(|maker| taken.insert(**maker)) {
                    open.push(*maker);
                }
            }
        }
        taken.into_iter().collect()
    }

    /// Something streamed that would have to be made again in a later round by a pass that also leaves something whole,
    /// which must be made once only.
    fn torn(&self, ops: &Ops) -> Option<Held> {
        self.rounds.iter().find_map(|round| {
            let again = |at: usize| !round.ends.contains(&at) && self.levels[at] < round.level && self.is_end(&self.list[at], ops);
            let twice = round.body.iter().find(|at| again(**at))?;
            let Op::Pass(pass) = &self.list[*twice] else { return None };
            if pass.stages.iter().all(|s| s.entry == Entry::Point) {
                return None;
            }
            let id = pass.writes.iter().map(|w| w.resource).find(|id| self.streamed.contains(id))?;
            Some(Held { id, why: format!("`{}` makes it together with what must be known before", node(pass, ops)) })
        })
    }

    /// For each level and size of images the operations that end there, with all that they need.
    fn find_rounds(&self, ops: &Ops) -> Vec<Round> {
        let mut groups: BTreeMap<(u32, [u32; 2]), Vec<usize>> = BTreeMap::new();
        for (i, op) in self.list.iter().enumerate() {
            if self.is_end(op, ops) {
                groups.entry((self.levels[i], size_of(op, ops))).or_default().push(i);
            }
        }
        groups.into_iter().map(|((level, _), ends)| Round { level, body: self.closure(&ends), ends }).collect()
    }
}

/// Width and height of what a streamed operation makes.
pub(super) fn size_of(op: &Op, ops: &Ops) -> [u32; 2] {
    match op {
        Op::Pass(pass) => pass.plane(ops),
        Op::Loop(l) => l.states.iter().find_map(|s| ops.shape(s.result).plane()),
    }
    .unwrap_or([1, 1])
}

/// What can be streamed, and which images cannot, with the reason.
fn streamed(list: &[Op], ops: &Ops, excluded: &[Held]) -> (BTreeSet<ResourceId>, Vec<Held>) {
    let candidate = |id: &ResourceId| {
        let resource = &ops.resources[id.index()];
        resource.shape.plane().is_some() && matches!(resource.origin, Origin::Pass | Origin::External { .. } | Origin::State)
    };
    let ids = (0..ops.resources.len() as u32).map(ResourceId);
    let mut streamed: BTreeSet<ResourceId> = ids.filter(candidate).collect();
    let mut held: Vec<Held> = Vec::new();
    let mut keep = |streamed: &mut BTreeSet<ResourceId>, id: ResourceId, why: String| {
        if streamed.remove(&id) {
            held.push(Held { id, why });
        }
    };
    for h in excluded {
        keep(&mut streamed, h.id, h.why.clone());
    }
    for kept in &ops.kept {
        keep(&mut streamed, kept.resource, "it is kept for the next frame".to_owned());
    }
    let overwritten: BTreeSet<ResourceId> = list.iter().flat_map(Op::takes_over).collect();
    loop {
        let before = streamed.len();
        for op in list {
            // A later round would run it again, when that is gone.
            let own = op.takes_over();
            if op.sources().iter().any(|id| overwritten.contains(id) && !own.contains(id)) {
                for id in op.sources().into_iter().chain(op.results()) {
                    keep(&mut streamed, id, "it is needed together with what is overwritten later".to_owned());
                }
            }
            match op {
                Op::Pass(pass) => hold_for(pass, ops, &mut streamed, &mut keep),
                Op::Loop(l) => hold_for_loop(l, ops, &mut streamed, &mut keep),
            }
        }
        if streamed.len() == before {
            break;
        }
    }
    // Words of files that nobody streams, and what no pass touches, is no image that is held.
    let touched: BTreeSet<ResourceId> = list.iter().flat_map(|op| op.sources().into_iter().chain(op.results())).collect();
    held.retain(|h| touched.contains(&h.id));
    (streamed, held)
}

/// The node that a pass ends in.
fn node<'o>(pass: &KernelPass, ops: &'o Ops) -> &'o str {
    pass.nodes.last().map_or("", |label| &ops.nodes[label.0 as usize])
}

type Keep<'k> = dyn FnMut(&mut BTreeSet<ResourceId>, ResourceId, String) + 'k;

/// What a pass needs whole.
fn hold_for(pass: &KernelPass, ops: &Ops, streamed: &mut BTreeSet<ResourceId>, keep: &mut Keep<'_>) {
    let Some(size) = tileable(pass, ops) else {
        for id in pass.sources().chain(pass.writes.iter().map(|w| w.resource)).collect::<Vec<_>>() {
            keep(streamed, id, format!("`{}` works on whole images", node(pass, ops)));
        }
        return;
    };
    for (read, id) in pass.reads.iter().enumerate() {
        let other = ops.shape(*id).plane().is_some_and(|own| own != size);
        let held = match look(pass, read) {
            Look::Around(_) | Look::Block(_) => other,
            Look::Elsewhere(..) => false,
            Look::Whole => true,
        };
        if held {
            keep(streamed, *id, format!("`{}` reads it from anywhere", node(pass, ops)));
        }
    }
    for write in &pass.writes {
        if let Some(old) = write.in_place_of {
            for id in [old, write.resource] {
                keep(streamed, id, format!("`{}` updates it in place", node(pass, ops)));
            }
        }
    }
}

/// What a loop needs whole: everything, unless all that it does can be done in a tile.
fn hold_for_loop(l: &LoopOp, ops: &Ops, streamed: &mut BTreeSet<ResourceId>, keep: &mut Keep<'_>) {
    let states: Vec<ResourceId> = l.states.iter().flat_map(|s| [s.init, s.carried, s.next, s.result]).collect();
    let size = ops.shape(states[0]).plane();
    let own = loop_own(l);
    let all_streamed = states.iter().chain(&own).all(|id| streamed.contains(id) && ops.shape(*id).plane() == size);
    let all_tileable =
        l.body.iter().all(|op| matches!(op, Op::Pass(pass) if tileable(pass, ops) == size && look_is_bounded(pass, streamed)));
    if all_streamed && all_tileable && loop_reach(l).is_some() {
        return;
    }
    let outside: Vec<ResourceId> = l.body.iter().flat_map(Op::sources).collect();
    for id in states.into_iter().chain(own).chain(outside) {
        keep(streamed, id, format!("the iterations of `{}` need it whole", ops.nodes[l.node.0 as usize]));
    }
}

/// Whether a pass in a loop looks at streamed resources within a reach: blocks would have to be whole in every iteration.
fn look_is_bounded(pass: &KernelPass, streamed: &BTreeSet<ResourceId>) -> bool {
    pass.reads.iter().enumerate().filter(|(_, id)| streamed.contains(id)).all(|(read, _)| matches!(look(pass, read), Look::Around(_)))
}

/// The round in which each operation can run first.
fn levels(list: &[Op], streamed: &BTreeSet<ResourceId>) -> Vec<u32> {
    let mut ready: BTreeMap<ResourceId, u32> = BTreeMap::new();
    let mut read: BTreeMap<ResourceId, u32> = BTreeMap::new();
    let mut levels = Vec::with_capacity(list.len());
    for op in list {
        // What it overwrites was read before.
        let (sources, own) = (op.sources(), op.takes_over());
        let times = sources.iter().filter_map(|id| ready.get(id)).chain(own.iter().filter_map(|id| read.get(id)));
        let level = times.copied().max().unwrap_or(0);
        for id in sources {
            let known = read.entry(id).or_default();
            *known = level.max(*known);
        }
        let by_tiles = op.sources().iter().chain(&op.results()).any(|id| streamed.contains(id));
        for id in op.results() {
            let whole = !streamed.contains(&id);
            ready.insert(id, level + u32::from(by_tiles && whole));
        }
        levels.push(level);
    }
    levels
}
