//! Images that do not fit: passes are run tile by tile.
//!
//! A resource is *streamed* when only a window of it need be held at a time: an image, or pixels of a file, that is made
//! pixel by pixel (or block by block) and that everybody looks at within a bounded reach. Everything else (tables,
//! scalars, volumes, images that somebody reads from anywhere) is held whole.
//!
//! What a reduction leaves in a table is known once all tiles have passed; so passes have *levels*: one that needs such
//! a table, directly or not, is a level above the reduction. Each level that ends in something held whole, or in pixels
//! for the host, becomes one [`TilingOp`], with everything streamed that it needs, back to the files; what two levels
//! need is computed in both. So the statistics of an image and what is made of them take two rounds over its tiles, and
//! no image is ever held.
//!
//! How wide a window is follows from reaches, from the last pass back to the first. A loop over streamed states runs
//! whole inside a tile, on windows that are wider by the reach of all its iterations.

use std::collections::{BTreeMap, BTreeSet};

use pipe_graph::pass::{Access, Border, Count, Entry, Grid, Limits, Origin, Reach, Resource, ResourceId, Shape, State};

use crate::error::human;
use crate::kernel_pass::{Brought, KernelPass, LoopOp, Op, Ops, Portion, Source, Stage, TilingOp};
use crate::schedule::Schedule;
use crate::window::{Halo, Windows};
use crate::{Options, Plan, PlanError};

/// Pixels that may be computed for each that is wanted: beyond, more than half of the work is wasted on halos.
const MOST_WORK: f32 = 2.0;

/// Overlap that is not worth smaller tiles or shorter rows of pixels.
const LITTLE_WORK: f32 = 1.25;

/// Width and height below which tiles are not halved.
const LEAST: u32 = 16;

/// Bytes of pixels that the host should hold of a row of tiles.
const HOST_BYTES: u64 = 256 << 20;

/// The best plan over tiles: the largest that fit, and of those that overlap much, those that overlap least. Answers why
/// there is none.
pub(crate) fn plan(name: &str, schedule: &Schedule, limits: &Limits, options: &Options) -> Result<Plan, String> {
    let streams = Streams::of(schedule);
    if !streams.any() {
        return Err(streams.culprit(&schedule.ops).unwrap_or_else(|| "no pass of it works on a part of an image alone".to_owned()));
    }
    let mut sizes = streams.candidates(&schedule.ops, limits, options);
    sizes.sort_by(|a, b| {
        let cost = |c: &Candidate| if c.work <= LITTLE_WORK { 0.0 } else { c.work };
        let area = |c: &Candidate| u64::from(c.step[0]) * u64::from(c.step[1]);
        cost(a).total_cmp(&cost(b)).then(area(b).cmp(&area(a))).then(b.step.cmp(&a.step))
    });
    let mut reason = None;
    for candidate in &sizes {
        if candidate.work > MOST_WORK {
            let [w, h] = candidate.step;
            reason = Some(format!(
                "tiles of {w}x{h} would compute {:.1} times the pixels that are wanted, since passes look so far around",
                candidate.work
            ));
            break;
        }
        match crate::allocate::allocate(name, streams.cut(schedule.ops.clone(), candidate.step), limits, options) {
            Ok(plan) => return Ok(plan),
            Err(error) if error.is_about_size() => {
                let [w, h] = candidate.step;
                reason = Some(format!("with tiles of {w}x{h}, {}", error.reason()));
            }
            Err(error) => return Err(error.to_string()),
        }
    }
    Err(streams.culprit(&schedule.ops).or(reason).unwrap_or_else(|| streams.widest(&schedule.ops)))
}

/// The plan over tiles of this size; over whole images where nothing can be made in tiles.
pub(crate) fn plan_in(name: &str, schedule: Schedule, limits: &Limits, options: &Options, step: [u32; 2]) -> Result<Plan, PlanError> {
    crate::allocate::allocate(name, cut_in(schedule, step), limits, options)
}

/// The schedule over tiles of this size; as it is where nothing can be made in tiles.
pub(crate) fn cut_in(schedule: Schedule, step: [u32; 2]) -> Schedule {
    let streams = Streams::of(&schedule);
    if streams.any() { streams.cut(schedule.ops, step.map(|n| n.max(1))) } else { schedule }
}

/// A size of tiles.
struct Candidate {
    step: [u32; 2],
    work: f32,
}

/// How a pass looks at something that it reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Look {
    /// At most so many pixels to each side.
    Around([u32; 2]),
    /// At the pixels of its block, and so many around them.
    Block([u32; 2]),
    /// Anywhere.
    Whole,
}

impl Look {
    fn and(self, other: Self) -> Self {
        let max = |a: [u32; 2], b: [u32; 2]| [a[0].max(b[0]), a[1].max(b[1])];
        match (self, other) {
            (Self::Whole, _) | (_, Self::Whole) => Self::Whole,
            (Self::Around(a), Self::Around(b)) => Self::Around(max(a, b)),
            (Self::Around(a) | Self::Block(a), Self::Around(b) | Self::Block(b)) => Self::Block(max(a, b)),
        }
    }

    /// A look of the first at values, each of which is made by a look of the second.
    fn through(self, inner: Self) -> Self {
        let add = |a: [u32; 2], b: [u32; 2]| [a[0].saturating_add(b[0]), a[1].saturating_add(b[1])];
        match (self, inner) {
            (Self::Whole, _) | (_, Self::Whole) => Self::Whole,
            (Self::Around(a), Self::Around(b)) => Self::Around(add(a, b)),
            (Self::Around(a) | Self::Block(a), Self::Around(b) | Self::Block(b)) => Self::Block(add(a, b)),
        }
    }
}

/// How a pass looks at the resource `read`, through whichever of its stages.
fn look(pass: &KernelPass, read: usize) -> Look {
    fn of_stage(pass: &KernelPass, stage: &Stage, read: usize) -> Look {
        let none = Look::Around([0, 0]);
        stage.ports.iter().fold(none, |seen, port| {
            let inner = match port.source {
                Source::Read(r) if r == read => none,
                Source::Read(_) => return seen,
                Source::Stage(k) if reads(pass, k, read) => of_stage(pass, &pass.stages[k], read),
                Source::Stage(_) => return seen,
            };
            let wraps = |x: u32, y: u32| port.border == Border::Repeat && (x, y) != (0, 0);
            let own = match port.reach {
                Reach::Point => Look::Around([0, 0]),
                // What lies beyond the other edge is never in the window.
                Reach::Around(x, y) if !wraps(x, y) => Look::Around([x, y]),
                Reach::Whole if port.once && pass.block().is_some() => Look::Block([0, 0]),
                Reach::Around(..) | Reach::Whole => Look::Whole,
            };
            seen.and(own.through(inner))
        })
    }
    let results = pass.writes.iter().map(|w| w.stage).chain([pass.stages.len() - 1]);
    results.map(|s| of_stage(pass, &pass.stages[s], read)).fold(Look::Around([0, 0]), Look::and)
}

/// Whether a stage asks for a read, itself or through others.
fn reads(pass: &KernelPass, stage: usize, read: usize) -> bool {
    pass.stages[stage].ports.iter().any(|p| match p.source {
        Source::Read(r) => r == read,
        Source::Stage(k) => reads(pass, k, read),
    })
}

/// Whether a pass can make a part of its pixels alone: the size of the whole image where it can.
fn tileable(pass: &KernelPass, ops: &Ops) -> Option<[u32; 2]> {
    let size = pass.plane(ops)?;
    let entry = pass.last().entry;
    let grid = match pass.grid {
        Grid::Cover => {
            matches!(ops.shape(pass.writes[0].resource), Shape::Image(_)) && matches!(entry, Entry::Point | Entry::At | Entry::Each)
        }
        Grid::Blocks(_) => matches!(entry, Entry::Each | Entry::Kernel),
        Grid::Walk(_) => true,
        Grid::Pixels(_) => entry == Entry::Each,
        Grid::Elements(_) | Grid::Groups(_) => false,
    };
    let alike = pass.writes.iter().all(|w| match ops.shape(w.resource) {
        Shape::Image(t) => t.size == size && w.in_place_of.is_none(),
        Shape::Pixels { size: own, .. } => own == size,
        Shape::Volume(_) => false,
        // Where tiles overlap, pixels are made twice, but must be counted once.
        _ => w.access == Access::Store || !pass.makes_pixels(ops),
    });
    (grid && alike).then_some(size)
}

/// Why tiles cannot be made: what must be held whole, and its reader.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Held {
    id: ResourceId,
    why: String,
}

/// One way through all tiles.
#[derive(Debug, Clone)]
struct Round {
    level: u32,
    /// The operations that leave something whole, or that the host takes from, by position.
    ends: Vec<usize>,
    /// Everything that runs, by position, in order.
    body: Vec<usize>,
}

/// What is streamed, and in which round each operation runs.
struct Streams {
    list: Vec<Op>,
    streamed: BTreeSet<ResourceId>,
    /// By position in `list`.
    levels: Vec<u32>,
    makers: BTreeMap<ResourceId, usize>,
    rounds: Vec<Round>,
    /// What is held whole although it is an image, with the reason.
    held: Vec<Held>,
}

impl Streams {
    /// Finds what can be streamed.
    fn of(schedule: &Schedule) -> Self {
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

    /// The largest image that is held whole, and why.
    fn culprit(&self, ops: &Ops) -> Option<String> {
        let largest = self.held.iter().max_by_key(|h| ops.shape(h.id).bytes())?;
        let resource = &ops.resources[largest.id.index()];
        Some(format!("`{}` needs {} whole, since {}", resource.name, human(&resource.shape.bytes()), largest.why))
    }

    /// What the smallest tiles need most of.
    fn widest(&self, ops: &Ops) -> String {
        let schedule = self.cut(ops.clone(), [LEAST; 2]);
        let tilings = schedule.portions.iter().filter_map(|p| if let Portion::Tiles(t) = p { Some(t) } else { None });
        let held = tilings.flat_map(|t| t.windows.halos.keys()).map(|id| &schedule.ops.resources[id.index()]);
        let widest = held.max_by_key(|r| r.shape.bytes());
        widest.map_or_else(String::new, |r| {
            format!("even for tiles of {LEAST}x{LEAST} `{}` takes {}, since passes look so far around", r.name, human(&r.shape.bytes()))
        })
    }

    /// Sizes of tiles that may fit, halved again and again from the whole image; how much they overlap.
    fn candidates(&self, ops: &Ops, limits: &Limits, options: &Options) -> Vec<Candidate> {
        let budget = options.budget.into_iter().chain(limits.budget).min().unwrap_or(u64::MAX);
        let sizes = self.streamed.iter().filter_map(|id| ops.shape(*id).plane());
        let size = sizes.fold([1, 1], |a, b| [a[0].max(b[0]), a[1].max(b[1])]);
        let halved = |n: u32| {
            let below = (0..32).rev().map(|k| 1_u32 << k).filter(move |p| *p < n && *p >= LEAST.min(n));
            std::iter::once(n).chain(below).collect::<Vec<_>>()
        };
        let mut found = Vec::new();
        for w in halved(size[0]) {
            for h in halved(size[1]) {
                let schedule = self.cut(ops.clone(), [w, h]);
                let tilings: Vec<&TilingOp> =
                    schedule.portions.iter().filter_map(|p| if let Portion::Tiles(t) = p { Some(t) } else { None }).collect();
                let held = || tilings.iter().flat_map(|t| t.windows.halos.keys());
                let fits = held().all(|id| match schedule.ops.shape(*id) {
                    Shape::Image(t) => t.size.iter().all(|n| *n <= limits.max_image) && schedule.ops.shape(*id).bytes() <= budget,
                    shape => shape.bytes() <= limits.max_binding_bytes.min(budget),
                });
                // What the host holds of a row of tiles, however it is cut along x.
                let host = tilings.iter().map(|t| {
                    let row = |b: &Brought| schedule.ops.shape(b.resource).bytes() / u64::from(w.min(size[0])) * u64::from(size[0]);
                    t.uploads.iter().chain(&t.fetches).map(row).sum::<u64>()
                });
                let work = tilings.iter().map(|t| t.work).fold(1.0, f32::max);
                if fits && (host.max().unwrap_or(0) <= HOST_BYTES || h <= LEAST) {
                    found.push(Candidate { step: [w, h], work });
                }
            }
        }
        found
    }

    /// Whether there is anything to stream.
    fn any(&self) -> bool {
        !self.streamed.is_empty()
    }

    fn is_streamed(&self, op: &Op) -> bool {
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

    /// The schedule over tiles of this size.
    fn cut(&self, mut ops: Ops, step: [u32; 2]) -> Schedule {
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
        let mut halos: BTreeMap<ResourceId, Halo> = BTreeMap::new();
        let mut work = 0.0;
        let empty = Windows { size, step, halos: BTreeMap::new() };
        let area = |halo: Halo| empty.largest(halo).iter().map(|n| f64::from(*n)).product::<f64>();
        for op in list.iter().rev() {
            let made = op.results().iter().filter_map(|id| halos.get(id)).fold(Halo::default(), |a, b| a.union(*b));
            work += match op {
                Op::Pass(pass) => {
                    self.widen(pass, ops, made, step, &mut halos);
                    area(made)
                }
                Op::Loop(l) => {
                    let wide = self.widen_loop(l, ops, made, step, &mut halos);
                    area(wide) * l.body.len() as f64
                }
            };
        }
        let passes: usize = list.iter().map(|op| if let Op::Loop(l) = op { l.body.len() } else { 1 }).sum();
        let work = work / (area(Halo::default()) * passes as f64);

        // A name of its own for whatever is held in part here.
        let windows = Windows { size, step, halos };
        let mut names: BTreeMap<ResourceId, ResourceId> = BTreeMap::new();
        let mut own = Windows { halos: BTreeMap::new(), ..windows.clone() };
        for (id, halo) in &windows.halos {
            let Resource { name, shape, origin } = ops.resources[id.index()].clone();
            let held = windows.largest(*halo);
            let shape = match shape {
                Shape::Image(t) => Shape::Image(t.with_size(held)),
                Shape::Pixels { pixel, .. } => Shape::Pixels { size: held, pixel },
                other => other,
            };
            ops.resources.push(Resource { name, shape, origin });
            let new = ResourceId(ops.resources.len() as u32 - 1);
            names.insert(*id, new);
            own.halos.insert(new, *halo);
        }
        list.iter_mut().for_each(|op| rename(op, &names));
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
    fn widen(&self, pass: &KernelPass, ops: &Ops, made: Halo, step: [u32; 2], halos: &mut BTreeMap<ResourceId, Halo>) {
        for write in pass.writes.iter().filter(|w| self.streamed.contains(&w.resource)) {
            halos.entry(write.resource).or_default();
        }
        for (read, id) in pass.reads.iter().enumerate().filter(|(_, id)| self.streamed.contains(id)) {
            // What a block leaves in a table comes from all of its pixels.
            let leaves_table = pass.writes.iter().any(|w| ops.shape(w.resource).plane().is_none());
            let needed = match (look(pass, read), pass.block()) {
                (Look::Around(reach), block) if block.is_none() || !leaves_table => made.plus(Halo::around(reach)),
                (Look::Around(reach) | Look::Block(reach), Some(block)) => {
                    made.plus(Halo::around(reach)).plus(self.to_blocks(pass, ops, block, step))
                }
                _ => unreachable!("what is read from anywhere is not streamed"),
            };
            let known = halos.entry(*id).or_default();
            *known = known.union(needed);
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

    /// The same for a loop; answers how far its own windows reach.
    fn widen_loop(&self, l: &LoopOp, ops: &Ops, made: Halo, step: [u32; 2], halos: &mut BTreeMap<ResourceId, Halo>) -> Halo {
        let wide = made.plus(loop_reach(l).unwrap_or_default());
        let inside: BTreeSet<ResourceId> = loop_own(l).into_iter().collect();
        let mut outside: BTreeMap<ResourceId, Halo> = BTreeMap::new();
        for op in &l.body {
            if let Op::Pass(pass) = op {
                self.widen(pass, ops, wide, step, &mut outside);
            }
        }
        for (id, halo) in outside {
            let own = if inside.contains(&id) { wide } else { halo };
            let known = halos.entry(id).or_default();
            *known = known.union(own);
        }
        for id in inside.into_iter().chain(l.states.iter().flat_map(|s| [s.init, s.next, s.result])).filter(|id| self.streamed.contains(id))
        {
            let known = halos.entry(id).or_default();
            *known = known.union(wide);
        }
        wide
    }
}

/// Resources that exist inside a loop only.
fn loop_own(l: &LoopOp) -> Vec<ResourceId> {
    let body = l.body.iter().flat_map(Op::results);
    body.chain(l.states.iter().map(|s| s.carried)).collect()
}

/// How far all iterations of a loop look together; `None` for a loop that cannot run in a tile.
fn loop_reach(l: &LoopOp) -> Option<Halo> {
    let Count::Fixed(n) = l.count else { return None };
    let mut far: BTreeMap<ResourceId, [u32; 2]> = BTreeMap::new();
    for op in &l.body {
        let Op::Pass(pass) = op else { return None };
        let mut own = [0, 0];
        for (read, id) in pass.reads.iter().enumerate() {
            let before = far.get(id).copied().unwrap_or_default();
            match look(pass, read) {
                Look::Around(reach) => own = [0, 1].map(|i| own[i].max(before[i].saturating_add(reach[i]))),
                // Tables and scalars from outside.
                Look::Whole | Look::Block(_) => {}
            }
        }
        far.extend(pass.writes.iter().map(|w| (w.resource, own)));
    }
    let reaches = l.states.iter().map(|s: &State| far.get(&s.next).copied().unwrap_or_default());
    let most = reaches.fold([0, 0], |a, b| [a[0].max(b[0]), a[1].max(b[1])]);
    Some(Halo::around(most).times(n))
}

/// Width and height of what a streamed operation makes.
fn size_of(op: &Op, ops: &Ops) -> [u32; 2] {
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
        if other || look(pass, read) == Look::Whole {
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

/// Gives what an operation names other names.
fn rename(op: &mut Op, names: &BTreeMap<ResourceId, ResourceId>) {
    let to = |id: &mut ResourceId| {
        if let Some(new) = names.get(id) {
            *id = *new;
        }
    };
    match op {
        Op::Pass(pass) => {
            pass.reads.iter_mut().for_each(to);
            pass.writes.iter_mut().for_each(|w| to(&mut w.resource));
        }
        Op::Loop(l) => {
            for s in &mut l.states {
                [&mut s.init, &mut s.carried, &mut s.next, &mut s.result].into_iter().for_each(to);
            }
            l.body.iter_mut().for_each(|op| rename(op, names));
        }
    }
}
