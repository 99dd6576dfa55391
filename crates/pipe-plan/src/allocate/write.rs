//! Steps over values, written down as steps over slots.

use pipe_graph::pass::{Count, ResourceId, Shape};

use super::{Draft, RepeatDraft, RunDraft, TilesDraft, ValueId};
use crate::compose::{Cover, Place, Placed};
use crate::kernel_pass::{Brought, KernelPass, Ops};
use crate::plan::{Crossing, Rect, Repeat, Run, SlotId, Step, Tile, Tiling, Times};
use crate::window::Windows;

/// Turns drafts into steps.
pub(super) struct Writer<'a> {
    pub(super) ops: &'a Ops,
    pub(super) slot_of: &'a [SlotId],
    pub(super) uniforms: Vec<u8>,
    pub(super) bytes_moved: u64,
    /// The launches of the body that is being written, where that is one of tiles.
    pub(super) launched: Option<Vec<Launched>>,
}

/// A launch of a tile's body, with what differs from tile to tile.
pub(super) struct Launched {
    pass: KernelPass,
    places: Vec<Place>,
    cover: Cover,
    uniform_offset: u32,
}

impl Launched {
    /// Writes its words of the uniform buffer for a tile, and answers its workgroups.
    fn place(&self, ops: &Ops, windows: &Windows, tile: &Rect, uniforms: &mut Vec<(u32, i32)>) -> [u32; 3] {
        let grid = self.pass.grid_in(ops, windows, tile);
        let origin = |r: &Rect| [r.x.start as i32, r.y.start as i32];
        for place in &self.places {
            let [x, y] = match place.what {
                Placed::GridFirst => origin(&grid),
                Placed::GridEnd => [grid.x.end as i32, grid.y.end as i32],
                Placed::First(id) => origin(&windows.part(id, tile)),
                Placed::Size(id) => windows.part(id, tile).size().map(|n| n as i32),
                Placed::Whole(id) => windows.size_of(id).map(|n| n as i32),
            };
            let at = self.uniform_offset + place.offset as u32;
            uniforms.extend([(at, x), (at + 4, y)]);
        }
        let [w, h] = grid.size();
        if w == 0 || h == 0 { [0; 3] } else { self.cover.groups_of([w, h, 1]) }
    }
}

impl Writer<'_> {
    pub(super) fn steps(&mut self, drafts: Vec<Draft>) -> Vec<Step> {
        let one = |draft| match draft {
            Draft::Run(run) => Step::Run(self.run(run)),
            Draft::Repeat(r) => Step::Repeat(self.repeat(r)),
            Draft::Tiles(t) => Step::Tiles(self.tiles(t)),
        };
        drafts.into_iter().map(one).collect()
    }

    fn run(&mut self, draft: RunDraft) -> Run {
        let RunDraft { pass, composed, slots, clears } = draft;
        let groups = composed.cover.groups;
        let uniform_offset = if composed.uniforms.is_empty() {
            0
        } else {
            self.uniforms.resize(self.uniforms.len().next_multiple_of(256), 0);
            let offset = self.uniforms.len() as u32;
            self.uniforms.extend(&composed.uniforms);
            offset
        };
        let name = |id: &ResourceId| self.ops.resources[id.index()].name.clone();
        let reads: Vec<ResourceId> = pass.reads.iter().copied().chain(pass.drivers()).collect();
        let writes: Vec<ResourceId> = pass.writes.iter().map(|w| w.resource).collect();
        let bytes = reads.iter().chain(&writes).map(|id| self.ops.shape(*id).bytes()).sum();
        self.bytes_moved += bytes;
        let run = Run {
            name: pass.name.clone(),
            nodes: pass.nodes.iter().map(|n| self.ops.nodes[n.0 as usize].clone()).collect(),
            kernel: composed.kernel,
            slots: slots.iter().map(|v| self.slot_of[v.0]).collect(),
            uniform_offset,
            groups,
            clears: clears.iter().map(|v| self.slot_of[v.0]).collect(),
            bytes,
            reads: reads.iter().map(name).collect(),
            writes: writes.iter().map(name).collect(),
        };
        if let Some(launched) = &mut self.launched {
            launched.push(Launched { pass, places: composed.places, cover: composed.cover, uniform_offset });
        }
        run
    }

    fn tiles(&mut self, t: TilesDraft) -> Tiling {
        let before = self.bytes_moved;
        self.launched = Some(Vec::new());
        let body = self.steps(t.body);
        let launched = self.launched.take().unwrap_or_default();
        let slot = |v: &ValueId| self.slot_of[v.0];
        let crossing = |(brought, value): &(Brought, ValueId), tile: &Rect| {
            let Shape::Pixels { pixel, .. } = self.ops.shape(brought.resource) else {
                unreachable!("only pixels cross the rim tile by tile")
            };
            let rect = t.windows.part(brought.resource, tile);
            let Brought { name, plane, .. } = brought.clone();
            Crossing { name, plane, pixel, size: t.windows.size_of(brought.resource), rect, slot: slot(value) }
        };
        let one = |tile: &Rect| {
            let mut uniforms = Vec::new();
            let groups = launched.iter().map(|l| l.place(self.ops, &t.windows, tile, &mut uniforms)).collect();
            let cross = |list: &[(Brought, ValueId)]| list.iter().map(|b| crossing(b, tile)).collect();
            Tile { uploads: cross(&t.uploads), uniforms, groups, fetches: cross(&t.fetches) }
        };
        let tiles: Vec<Tile> = t.windows.tiles().iter().map(one).collect();
        let mut names: Vec<&str> = t.fetches.iter().map(|(b, _)| b.name.as_str()).collect();
        names.dedup();
        let name = if names.is_empty() { launched.last().map_or_else(String::new, |l| l.pass.name.clone()) } else { names.join("+") };
        self.bytes_moved = before + (self.bytes_moved - before) * tiles.len() as u64;
        let clears = t.clears.iter().map(slot).collect();
        Tiling { name, size: t.windows.size, step: t.windows.step, work: t.work, clears, body, tiles }
    }

    fn repeat(&mut self, r: RepeatDraft) -> Repeat {
        let before = self.bytes_moved;
        let first = self.steps(r.first);
        let once = self.bytes_moved - before;
        let (odd, even) = (self.steps(r.odd), self.steps(r.even));
        let slot = |v: &ValueId| self.slot_of[v.0];
        let count = match (r.count, r.until) {
            (Count::Until { limit, every, max, .. }, Some(value)) => {
                Times::Until { value: [slot(&value[0]), slot(&value[1])], limit, every, max }
            }
            (Count::Fixed(n) | Count::Until { max: n, .. }, _) => Times::Fixed(n),
        };
        self.bytes_moved = before + once * u64::from(count.least());
        Repeat {
            name: r.name,
            node: r.node,
            first,
            odd,
            even,
            count,
            settle: r.settle.iter().map(|(from, to)| (slot(from), slot(to))).collect(),
        }
    }
}
