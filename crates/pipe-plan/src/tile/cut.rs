//! Rounds → tilings: windows from the last pass back to the first, and resources of their own for what is held in part.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use pipe_graph::pass::{Origin, Resource, ResourceId, Shape};

use super::look::{Look, look, loop_own, loop_reach};
use super::streams::{Round, Streams, size_of};
use crate::kernel_pass::{Brought, KernelPass, LoopOp, Op, Ops, Portion, TilingOp};
use crate::schedule::Schedule;
use crate::window::{Halo, View, Windows};

/// Makes the windows of a resource hold these.
fn hold(views: &mut BTreeMap<ResourceId, View>, id: ResourceId, view: View) {
    match views.entry(id) {
        Entry::Occupied(mut known) => known.get_mut().unite(&view),
        Entry::Vacant(new) => drop(new.insert(view)),
    }
}

impl Streams {
    /// The schedule over tiles of this size.
    pub(super) fn cut(&self, mut ops: Ops, step: [u32; 2]) -> Schedule {
        let mut portions = Vec::new();
        let last = self.levels.iter().copied().max().unwrap_or(0);
        for level in 0..=last {
            let whole = self.list.iter().zip(&self.levels).filter(|(op, l)| **l == level && !self.is_streamed(op));
            let whole: Vec<Op> = whole.map(|(op, _)| op.clone()).collect();
            if !whole.is_empty() {
                portions.push(Portion::Whole(whole));
            }
            for round in self.rounds.iter().filter(|r| r.level == level) {
                portions.push(Portion::Tiles(self.tiling(&mut ops, round, step)));
            }
        }
        // What the host takes tile by tile is no fetch of the end.
        for fetch in &mut ops.fetches {
            fetch.parts.retain(|(id, _)| !self.streamed.contains(id));
        }
        ops.fetches.retain(|f| !f.parts.is_empty());
        Schedule { ops, portions }
    }

    /// A round over tiles of this size.
    fn tiling(&self, ops: &mut Ops, Round { ends, body, .. }: &Round, step: [u32; 2]) -> TilingOp {
        let mut list: Vec<Op> = body.iter().map(|i| self.list[*i].clone()).collect();
        let size = size_of(&self.list[ends[0]], ops);
        let step = [step[0].min(size[0]), step[1].min(size[1])];
        // What another round leaves is not made again.
        for (op, at) in list.iter_mut().zip(body) {
            if let (Op::Pass(pass), false) = (op, ends.contains(at)) {
                pass.writes.retain(|w| self.streamed.contains(&w.resource));
            }
        }
        let tile = View::tiles(size, step);
        let mut views: BTreeMap<ResourceId, View> = BTreeMap::new();
        // Pixels that are computed, and those that there are.
        let (mut computed, mut all) = (0.0, 0.0);
        for (op, at) in list.iter().zip(body).rev() {
            let mut made: Option<View> = None;
            for id in op.results() {
                let Some(view) = views.get_mut(&id) else { continue };
                if ends.contains(at) {
                    // Whatever others look at, all of it is made.
                    view.unite(&tile);
                }
                made.get_or_insert_with(|| view.clone()).unite(view);
            }
            let made = made.unwrap_or_else(|| tile.clone());
            let pixels = made.size.iter().map(|n| f64::from(*n)).product::<f64>();
            let (passes, made) = match op {
                Op::Pass(pass) => {
                    self.widen(pass, ops, &made, step, &mut views);
                    (1.0, made)
                }
                Op::Loop(l) => (l.body.len() as f64, self.widen_loop(l, ops, made, step, &mut views)),
            };
            computed += made.area() * passes;
            all += pixels * passes;
        }
        let work = computed / all;

        // A name of its own for whatever is held in part here.
        let mut names: BTreeMap<ResourceId, ResourceId> = BTreeMap::new();
        let mut own = Windows { size, step, views: BTreeMap::new() };
        for (id, view) in views {
            let Resource { name, shape, origin } = ops.resources[id.index()].clone();
            let held = view.largest();
            let shape = match shape {
                Shape::Image(t) => Shape::Image(t.with_size(held)),
                Shape::Pixels { pixel, .. } => Shape::Pixels { size: held, pixel },
                other => other,
            };
            ops.resources.push(Resource { name, shape, origin });
            let new = ResourceId(ops.resources.len() as u32 - 1);
            names.insert(id, new);
            own.views.insert(new, view);
        }
        list.iter_mut().for_each(|op| op.rename(&names));
        let mut uploads = Vec::new();
        for (old, new) in &names {
            if let Origin::External { name, ranges } = &ops.resources[old.index()].origin {
                let first = ranges.first().map_or(0, |r| r.start);
                let plane = if let Shape::Pixels { size: [w, h], pixel } = ops.shape(*old) {
                    first / (u64::from(w) * u64::from(h) * u64::from(pixel)).max(1)
                } else {
                    0
                };
                uploads.push(Brought { name: name.clone(), plane: plane as u32, resource: *new });
            }
        }
        let mut fetches = Vec::new();
        for fetch in &ops.fetches {
            for (plane, (id, _)) in fetch.parts.iter().enumerate() {
                let made_here = ends.iter().any(|at| self.list[*at].results().contains(id));
                if let Some(new) = names.get(id).filter(|_| made_here) {
                    fetches.push(Brought { name: fetch.name.clone(), plane: plane as u32, resource: *new });
                }
            }
        }
        TilingOp { body: list, windows: own, uploads, fetches, work: work as f32 }
    }

    /// Widens the windows of what a pass reads, given that of what it makes.
    fn widen(&self, pass: &KernelPass, ops: &Ops, made: &View, step: [u32; 2], views: &mut BTreeMap<ResourceId, View>) {
        for write in pass.writes.iter().filter(|w| self.streamed.contains(&w.resource)) {
            views.entry(write.resource).or_insert_with(|| made.clone());
        }
        for (read, id) in pass.reads.iter().enumerate().filter(|(_, id)| self.streamed.contains(id)) {
            // What a block leaves in a table comes from all of its pixels.
            let leaves_table = pass.writes.iter().any(|w| ops.shape(w.resource).plane().is_none());
            let needed = match (look(pass, read), pass.block()) {
                (Look::Around(reach), block) if block.is_none() || !leaves_table => made.clone().plus(Halo::around(reach)),
                (Look::Around(reach) | Look::Block(reach), Some(block)) => {
                    made.clone().plus(Halo::around(reach)).plus(self.to_blocks(pass, ops, block, step))
                }
                (Look::Elsewhere(looks, border), _) => made.through(looks, border, ops.shape(*id).plane().unwrap_or_default()),
                _ => unreachable!("what is read from anywhere is not streamed"),
            };
            hold(views, *id, needed);
        }
    }

    /// How far whole blocks reach beyond a tile. A pass that makes pixels runs each block that the window meets; one that
    /// leaves only tables runs a block in the tile that it begins in.
    fn to_blocks(&self, pass: &KernelPass, ops: &Ops, block: [u32; 2], step: [u32; 2]) -> Halo {
        let makes_pixels = pass.makes_pixels(ops);
        let beyond = |i: usize| if step[i].is_multiple_of(block[i]) && !makes_pixels { 0 } else { block[i] - 1 };
        let after = [beyond(0), beyond(1)];
        Halo { before: if makes_pixels { after } else { [0, 0] }, after }
    }

    /// The same for a loop; answers its own windows.
    fn widen_loop(&self, l: &LoopOp, ops: &Ops, made: View, step: [u32; 2], views: &mut BTreeMap<ResourceId, View>) -> View {
        let wide = made.plus(loop_reach(l).unwrap_or_default());
        let inside: BTreeSet<ResourceId> = loop_own(l).into_iter().collect();
        let mut outside: BTreeMap<ResourceId, View> = BTreeMap::new();
        for op in &l.body {
            if let Op::Pass(pass) = op {
                self.widen(pass, ops, &wide, step, &mut outside);
            }
        }
        let states = l.states.iter().flat_map(|s| [s.init, s.next, s.result]);
        let whole = inside.iter().copied().chain(states).filter(|id| self.streamed.contains(id)).map(|id| (id, wide.clone()));
        for (id, view) in outside.into_iter().filter(|(id, _)| !inside.contains(id)).chain(whole.collect::<Vec<_>>()) {
            hold(views, id, view);
        }
        wide
    }
}
