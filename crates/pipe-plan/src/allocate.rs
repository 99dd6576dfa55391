//! Slots for resources, and the steps that use them.
//!
//! The schedule is played through once. A *value* is one content of storage over an interval of steps; a resource
//! inside a loop becomes three values, one for each of the copies of the body that [`Repeat`] has:
//!
//! - `first` (iteration 0) reads the initial states and writes the values called B,
//! - `odd` reads B and writes A, `even` reads A and writes B.
//!
//! A and B are the ping-pong pair of a state; both live through the whole loop, as does everything that the body
//! reads from outside, so plain interval colouring over the steps in the order first, odd, even is right for loops
//! too. A state that the body updates in place (`in_place_of`) is one value throughout. A state whose next value is
//! not written by a pass of the body for that state alone (two states that swap, an outer value) gets a copy pass.
//!
//! Colouring takes values in the order in which they begin and gives each the free slot of equal storage that was
//! freed last; for intervals that uses exactly as many slots as are alive at once.

use std::collections::{BTreeMap, BTreeSet};

use pipe_graph::pass::{Access, Count, Entry, Grid, Limits, Origin, Reach, ResourceId, Shader, Shape, State, Value, Values};
use pipe_graph::types::Precision;

use crate::compose::{Composed, Composer, Cover, Place, Placed};
use crate::kernel_pass::{Brought, KernelPass, LoopOp, Op, Ops, PassWrite, Portion, Source, Stage, StagePort, TilingOp};
use crate::plan::{Crossing, Fetched, History, Plan, Rect, Repeat, Run, Slot, SlotId, Step, Storage, Tile, Tiling, Times, Upload};
use crate::schedule::Schedule;
use crate::window::Windows;
use crate::{Options, PlanError};

/// What a device of unknown memory is taken to have when it is about keeping results.
const ASSUMED_BUDGET: u64 = 4 << 30;

/// Index of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct ValueId(usize);

/// One content of storage, from the step that writes it to the last step that reads it.
struct Held {
    resource: ResourceId,
    storage: Storage,
    from: usize,
    to: usize,
}

/// Which value a resource name stands for at some point.
type Names = BTreeMap<ResourceId, ValueId>;

/// A step over values; becomes a [`Step`] once slots are known.
enum Draft {
    Run(RunDraft),
    Repeat(RepeatDraft),
    Tiles(TilesDraft),
}

struct RunDraft {
    pass: KernelPass,
    composed: Composed,
    slots: Vec<ValueId>,
    clears: Vec<ValueId>,
}

struct RepeatDraft {
    name: String,
    node: String,
    first: Vec<Draft>,
    odd: Vec<Draft>,
    even: Vec<Draft>,
    count: Count,
    until: Option<[ValueId; 2]>,
    settle: Vec<(ValueId, ValueId)>,
}

struct TilesDraft {
    windows: Windows,
    work: f32,
    body: Vec<Draft>,
    clears: Vec<ValueId>,
    uploads: Vec<(Brought, ValueId)>,
    fetches: Vec<(Brought, ValueId)>,
}

/// Makes the plan.
pub(crate) fn allocate(name: &str, schedule: Schedule, limits: &Limits, options: &Options) -> Result<Plan, PlanError> {
    let Schedule { ops, portions } = schedule;
    let readers = readers(&ops, &portions);
    let composer = Composer::new(limits, &ops);
    let mut player = Player {
        ops: &ops,
        composer,
        readers,
        overwritten: overwritten(&portions),
        lasting: Vec::new(),
        held: Vec::new(),
        time: 1,
        windows: None,
    };
    let mut names = Names::new();
    let given = given(&ops, &portions);
    for id in &given {
        names.insert(*id, player.begin(*id, 0));
    }
    let mut drafts = Vec::new();
    for portion in &portions {
        match portion {
            Portion::Whole(list) => drafts.extend(player.region(list, &mut names)?),
            Portion::Tiles(tiling) => drafts.push(player.tiles(tiling, &mut names)?),
        }
    }
    let end = player.time + 1;
    for id in ops.wanted() {
        player.held[names[&id].0].to = end;
    }
    let Player { composer, held, .. } = player;
    let naive_bytes = held.iter().map(|h| h.storage.bytes()).sum();
    let share = !options.keep || naive_bytes > options.budget_on(limits).unwrap_or(ASSUMED_BUDGET) / 2;
    let (slot_of, mut slots) = colour(&held, share);
    let at = |id: ResourceId| slot_of[names[&id].0];

    let mut literals = Vec::new();
    let mut uploads: Vec<Upload> = Vec::new();
    for id in &given {
        match &ops.resources[id.index()].origin {
            Origin::Literal(bytes) => literals.push((at(*id), bytes.clone())),
            Origin::External { name, ranges } => uploads.push(Upload { name: name.clone(), ranges: ranges.clone(), slot: at(*id) }),
            Origin::Pass | Origin::State | Origin::History { .. } => continue,
        }
        slots[at(*id).0 as usize].uploaded = true;
    }
    let mut fetches = Vec::new();
    for fetch in &ops.fetches {
        let parts = fetch.parts.iter().map(|(id, range)| (at(*id), range.clone())).collect();
        fetches.push(Fetched { name: fetch.name.clone(), parts });
        for (id, _) in &fetch.parts {
            slots[at(*id).0 as usize].fetched = true;
        }
    }
    let histories = ops.kept.iter().map(|kept| {
        let recall = recalled(&ops, &given, &kept.name);
        History { name: kept.name.clone(), delay: kept.delay, keep: at(kept.resource), recall: recall.map(at) }
    });
    let histories = histories.collect();

    let mut writer = Writer { ops: &ops, slot_of: &slot_of, uniforms: Vec::new(), bytes_moved: 0, launched: None };
    let steps = writer.steps(drafts);
    let peak_bytes = slots.iter().map(|s| s.storage.bytes()).sum();
    check(&ops, &held, &slots, limits, options)?;
    Ok(Plan {
        name: name.to_owned(),
        limits: *limits,
        slots,
        kernels: composer.finish(),
        uniforms: writer.uniforms,
        literals,
        uploads,
        steps,
        fetches,
        histories,
        peak_bytes,
        naive_bytes,
        bytes_moved: writer.bytes_moved,
    })
}

/// What is there before the first step: literals, uploads, recalled values of earlier frames.
fn given(ops: &Ops, portions: &[Portion]) -> Vec<ResourceId> {
    let mut given: Vec<ResourceId> = portions.iter().flat_map(Portion::ops).flat_map(Op::sources).chain(ops.wanted()).collect();
    given.sort_unstable();
    given.dedup();
    given.retain(|id| !matches!(ops.resources[id.index()].origin, Origin::Pass | Origin::State));
    // What tiles need is brought for each.
    let brought: BTreeSet<ResourceId> = portions.iter().filter_map(Portion::tiling).flat_map(|t| &t.uploads).map(|u| u.resource).collect();
    given.retain(|id| !brought.contains(id));
    given
}

/// How many operations read each resource; what must stay has one reader more.
fn readers(ops: &Ops, portions: &[Portion]) -> BTreeMap<ResourceId, usize> {
    fn walk(list: &[Op], count: &mut BTreeMap<ResourceId, usize>) {
        for op in list {
            match op {
                Op::Pass(pass) => pass.sources().for_each(|id| *count.entry(id).or_default() += 1),
                Op::Loop(l) => {
                    l.states.iter().for_each(|s| *count.entry(s.init).or_default() += 1);
                    walk(&l.body, count);
                }
            }
        }
    }
    let mut count = BTreeMap::new();
    portions.iter().for_each(|p| walk(p.ops(), &mut count));
    ops.wanted().for_each(|id| *count.entry(id).or_default() += 1);
    count
}

/// What some pass takes over the storage of, as the initial value of a state too.
fn overwritten(portions: &[Portion]) -> BTreeSet<ResourceId> {
    fn walk(op: &Op) -> Vec<ResourceId> {
        match op {
            Op::Pass(_) => op.takes_over(),
            Op::Loop(l) => {
                let states = l.states.iter().filter(|s| updated_in_place(&l.body, s.next, s.carried)).map(|s| s.init);
                states.chain(l.body.iter().flat_map(walk)).collect()
            }
        }
    }
    portions.iter().flat_map(Portion::ops).flat_map(walk).collect()
}

/// The resource that recalls a history, when some pass reads it.
fn recalled(ops: &Ops, given: &[ResourceId], wanted: &str) -> Option<ResourceId> {
    let of_history = |id: &&ResourceId| matches!(&ops.resources[id.index()].origin, Origin::History { name, .. } if name == wanted);
    given.iter().find(of_history).copied()
}

/// Refuses what cannot run before anything is allocated.
fn check(ops: &Ops, held: &[Held], slots: &[Slot], limits: &Limits, options: &Options) -> Result<(), PlanError> {
    for value in held {
        let r = &ops.resources[value.resource.index()];
        match r.shape {
            Shape::Image(t) if t.size.iter().any(|n| *n > limits.max_image) => {
                return Err(PlanError::ImageTooLarge { name: r.name.clone(), size: t.size, most: limits.max_image });
            }
            Shape::Volume(t) if t.size.iter().any(|n| *n > limits.max_volume) => {
                return Err(PlanError::VolumeTooLarge { name: r.name.clone(), size: t.size, most: limits.max_volume });
            }
            Shape::Table { .. } | Shape::Words { .. } | Shape::Pixels { .. } if r.shape.bytes() > limits.max_binding_bytes => {
                return Err(PlanError::TableTooLarge { name: r.name.clone(), bytes: r.shape.bytes(), most: limits.max_binding_bytes });
            }
            _ if value.storage.bytes() > limits.max_piece => {
                return Err(PlanError::PieceTooLarge { name: r.name.clone(), bytes: value.storage.bytes(), most: limits.max_piece });
            }
            _ => {}
        }
    }
    let needed: u64 = slots.iter().map(|s| s.storage.bytes()).sum();
    match options.budget_on(limits) {
        Some(budget) if needed > budget => {
            let largest = held.iter().max_by_key(|value| value.storage.bytes());
            let (name, bytes) = largest.map(|v| (ops.resources[v.resource.index()].name.clone(), v.storage.bytes())).unwrap_or_default();
            Err(PlanError::Budget { needed, budget, name, bytes })
        }
        _ => Ok(()),
    }
}

/// Storage that holds a shape. Half images of 1 and 2 channels need a format that not every device can write.
fn storage(shape: Shape, limits: &Limits) -> Storage {
    match shape {
        Shape::Image(mut t) => {
            if t.channels < 4 && !limits.half_storage {
                t.precision = Precision::F32;
            }
            Storage::Image(t)
        }
        Shape::Volume(mut t) => {
            if t.channels < 4 && !limits.half_storage {
                t.precision = Precision::F32;
            }
            Storage::Volume(t)
        }
        Shape::Table { .. } | Shape::Words { .. } | Shape::Pixels { .. } | Shape::Scalar => {
            Storage::Buffer { bytes: shape.bytes().next_multiple_of(16).max(16) }
        }
    }
}

/// Interval colouring: a slot for each value, of its own unless values may share.
fn colour(held: &[Held], share: bool) -> (Vec<SlotId>, Vec<Slot>) {
    let mut order: Vec<usize> = (0..held.len()).collect();
    order.sort_by_key(|i| (held[*i].from, *i));
    let mut slots: Vec<(Slot, usize)> = Vec::new();
    let mut slot_of = vec![SlotId(u32::MAX); held.len()];
    for i in order {
        let value = &held[i];
        // The slot freed last: its content is most likely still in a cache.
        let free = slots.iter().enumerate().filter(|(_, (slot, until))| share && slot.storage == value.storage && *until < value.from);
        let found = free.max_by_key(|(id, (_, until))| (*until, usize::MAX - id)).map(|(id, _)| id);
        let id = found.unwrap_or_else(|| {
            slots.push((Slot { storage: value.storage, uploaded: false, fetched: false }, 0));
            slots.len() - 1
        });
        slots[id].1 = value.to;
        slot_of[i] = SlotId(id as u32);
    }
    (slot_of, slots.into_iter().map(|(slot, _)| slot).collect())
}

/// Plays the schedule through.
struct Player<'a> {
    ops: &'a Ops,
    composer: Composer<'a>,
    /// How many operations read a resource, with one more when it must stay.
    readers: BTreeMap<ResourceId, usize>,
    /// What some pass takes over the storage of, as the initial value of a state too.
    overwritten: BTreeSet<ResourceId>,
    /// What was there before the loop whose body is being played, which every iteration finds as it was.
    lasting: Vec<ValueId>,
    held: Vec<Held>,
    /// The current step; 0 is before the first.
    time: usize,
    /// Of the tiles that are being played.
    windows: Option<&'a Windows>,
}

impl<'a> Player<'a> {
    /// A new value of this resource's storage.
    fn begin(&mut self, id: ResourceId, from: usize) -> ValueId {
        let storage = storage(self.ops.shape(id), self.composer.limits());
        self.held.push(Held { resource: id, storage, from, to: from });
        ValueId(self.held.len() - 1)
    }

    fn touch(&mut self, value: ValueId) {
        let held = &mut self.held[value.0];
        held.to = held.to.max(self.time);
    }

    fn region(&mut self, list: &[Op], names: &mut Names) -> Result<Vec<Draft>, PlanError> {
        let mut drafts = Vec::with_capacity(list.len());
        for op in list {
            match op {
                Op::Pass(pass) => drafts.push(self.pass(pass, names)?),
                Op::Loop(l) => drafts.extend(self.repeat(l, names)?),
            }
        }
        Ok(drafts)
    }

    fn pass(&mut self, pass: &KernelPass, names: &mut Names) -> Result<Draft, PlanError> {
        let mut clears = Vec::new();
        for write in &pass.writes {
            if let Some(old) = write.in_place_of {
                names.insert(write.resource, names[&old]);
            } else if let std::collections::btree_map::Entry::Vacant(e) = names.entry(write.resource) {
                let value = self.begin(write.resource, self.time);
                e.insert(value);
            }
            // What tiles add to is cleared before the first of them.
            if self.windows.is_none() && write.in_place_of.is_none() && write.access != Access::Store {
                clears.push(names[&write.resource]);
            }
        }
        let composed = self.composer.compose(pass, self.windows)?;
        let slots: Vec<ValueId> = composed.resources.iter().map(|id| names[id]).collect();
        for value in &slots {
            self.touch(*value);
        }
        self.time += 1;
        Ok(Draft::Run(RunDraft { pass: pass.clone(), composed, slots, clears }))
    }

    /// Plays the body once. What it leaves whole, and what it reads from outside, lives from the first tile to the last.
    fn tiles(&mut self, tiling: &'a TilingOp, names: &mut Names) -> Result<Draft, PlanError> {
        let start = self.time;
        let mut lasting: Vec<ValueId> = names.values().copied().collect();
        let mut clears = Vec::new();
        for write in tiling.body.iter().filter_map(|op| if let Op::Pass(pass) = op { Some(&pass.writes) } else { None }).flatten() {
            if tiling.windows.views.contains_key(&write.resource) || write.in_place_of.is_some() {
                continue;
            }
            let value = self.begin(write.resource, start);
            names.insert(write.resource, value);
            lasting.push(value);
            if write.access != Access::Store {
                clears.push(value);
            }
        }
        let mut uploads = Vec::new();
        for upload in &tiling.uploads {
            let value = self.begin(upload.resource, start);
            names.insert(upload.resource, value);
            uploads.push((upload.clone(), value));
        }
        self.windows = Some(&tiling.windows);
        let body = self.region(&tiling.body, names)?;
        self.windows = None;
        let fetches: Vec<_> = tiling.fetches.iter().map(|f| (f.clone(), names[&f.resource])).collect();
        let used = used(&body);
        let taken = fetches.iter().map(|(_, value)| *value);
        for value in used.into_iter().filter(|v| lasting.contains(v)).chain(taken) {
            self.touch(value);
        }
        // The end is a moment of its own: nothing may take a slot before it.
        self.time += 1;
        let (windows, work) = (tiling.windows.clone(), tiling.work);
        Ok(Draft::Tiles(TilesDraft { windows, work, body, clears, uploads, fetches }))
    }

    fn repeat(&mut self, l: &LoopOp, names: &mut Names) -> Result<Vec<Draft>, PlanError> {
        let most = match l.count {
            Count::Fixed(n) | Count::Until { max: n, .. } => n,
        };
        // A state that never changes is what it was; where something overwrites either, the other is a copy.
        let (same, changing): (Vec<_>, Vec<_>) = l.states.iter().partition(|s| s.next == s.carried || most == 0);
        let mut before = Vec::new();
        for state in &same {
            if [state.init, state.result].iter().any(|id| self.overwritten.contains(id)) {
                let pass = copy_pass(l, state.init, state.result, self.ops);
                before.push(self.pass(&pass, names)?);
            } else {
                names.insert(state.result, names[&state.init]);
            }
            names.insert(state.carried, names[&state.init]);
        }
        if most == 0 {
            return Ok(before);
        }
        let mut body = l.body.clone();
        let mut nexts = Vec::new();
        for state in &changing {
            let next = if written_for(&body, state, &nexts) {
                state.next
            } else {
                // The copy borrows the name of the result: the same shape, and nothing in the body has it.
                body.push(Op::Pass(copy_pass(l, state.next, state.result, self.ops)));
                state.result
            };
            nexts.push(next);
        }
        let in_place: Vec<bool> = changing.iter().zip(&nexts).map(|(s, n)| updated_in_place(&body, *n, s.carried)).collect();

        // A state updated in place overwrites its initial value: what others still need is copied first.
        let mut inits: Vec<ResourceId> = changing.iter().map(|s| s.init).collect();
        for (i, state) in changing.iter().enumerate() {
            let made = matches!(self.ops.resources[state.init.index()].origin, Origin::Pass | Origin::State);
            let needed = !made || self.readers.get(&state.init).is_some_and(|n| *n > 1) || self.lasting.contains(&names[&state.init]);
            if in_place[i] && needed {
                let pass = copy_pass(l, state.init, state.carried, self.ops);
                before.push(self.pass(&pass, names)?);
                inits[i] = state.carried;
            }
        }
        let start = self.time;
        let outside: Vec<ValueId> = names.values().copied().collect();
        let lasting = std::mem::replace(&mut self.lasting, outside.clone());
        let mut value_pair = [None, None];
        let mut b = Vec::new();
        let mut a = Vec::new();

        // Iteration 0 reads the initial values.
        let mut first_names = names.clone();
        for (i, state) in changing.iter().enumerate() {
            let init = first_names[&inits[i]];
            first_names.insert(state.carried, init);
            let value = if in_place[i] { init } else { self.begin(nexts[i], start) };
            if !in_place[i] {
                first_names.insert(nexts[i], value);
            }
            b.push(value);
        }
        if let Count::Until { value, .. } = l.count {
            let own = changing.iter().any(|s| s.next == value);
            if !own {
                let held = self.begin(value, start);
                first_names.insert(value, held);
                value_pair[0] = Some(held);
            }
        }
        let first = self.region(&body, &mut first_names)?;
        if let Count::Until { value, .. } = l.count {
            value_pair[0] = Some(first_names[&value]);
        }

        let (mut odd, mut even) = (Vec::new(), Vec::new());
        if most > 1 {
            let odd_start = self.time;
            let mut odd_names = names.clone();
            for (i, (state, next)) in changing.iter().zip(&nexts).enumerate() {
                odd_names.insert(state.carried, b[i]);
                let value = if in_place[i] { b[i] } else { self.begin(*next, odd_start) };
                if !in_place[i] {
                    odd_names.insert(*next, value);
                }
                a.push(value);
            }
            odd = self.region(&body, &mut odd_names)?;
            if let Count::Until { value, .. } = l.count {
                value_pair[1] = Some(odd_names[&value]);
            }
            if most > 2 {
                let mut even_names = names.clone();
                for (i, (state, next)) in changing.iter().zip(&nexts).enumerate() {
                    even_names.insert(state.carried, a[i]);
                    if !in_place[i] {
                        even_names.insert(*next, b[i]);
                    }
                }
                if let (Count::Until { value, .. }, Some(held)) = (&l.count, value_pair[0]) {
                    even_names.insert(*value, held);
                }
                even = self.region(&body, &mut even_names)?;
            }
        }
        self.lasting = lasting;
        let end = self.time;
        // What the repeated part uses lives until the loop ends, since the loop comes back to it.
        if most > 1 {
            let repeated = used(&odd).into_iter().chain(used(&even));
            for value in repeated {
                if outside.contains(&value) || b.contains(&value) || a.contains(&value) {
                    self.held[value.0].to = self.held[value.0].to.max(end);
                }
            }
        }
        // What ends a loop is looked at behind an iteration.
        for value in value_pair.into_iter().flatten() {
            self.held[value.0].to = self.held[value.0].to.max(end);
        }
        let mut settle = Vec::new();
        for (i, state) in changing.iter().enumerate() {
            let result = match l.count {
                _ if in_place[i] || most == 1 => b[i],
                Count::Fixed(n) => {
                    if n % 2 == 1 {
                        b[i]
                    } else {
                        a[i]
                    }
                }
                Count::Until { .. } => {
                    settle.push((b[i], a[i]));
                    a[i]
                }
            };
            for value in [Some(&b[i]), a.get(i)].into_iter().flatten() {
                self.held[value.0].to = self.held[value.0].to.max(end);
            }
            names.insert(state.result, result);
        }
        // The end of the loop is a moment of its own: nothing may take a slot before it.
        self.time += 1;
        let until = matches!(l.count, Count::Until { .. }).then(|| {
            let first = value_pair[0].expect("the resolver found the value in the body");
            [first, value_pair[1].unwrap_or(first)]
        });
        before.push(Draft::Repeat(RepeatDraft {
            name: l.name.clone(),
            node: self.ops.nodes[l.node.0 as usize].clone(),
            first,
            odd,
            even,
            count: l.count.clone(),
            until,
            settle,
        }));
        Ok(before)
    }
}

/// Whether a pass of the body writes the next value of a state into storage of the state's own: not in the place of something
/// else that the body makes, nor where another state has it already.
fn written_for(body: &[Op], state: &State, claimed: &[ResourceId]) -> bool {
    let writes = body.iter().filter_map(|op| if let Op::Pass(p) = op { Some(&p.writes) } else { None });
    let write = writes.flatten().find(|w| w.resource == state.next);
    let own = |w: &PassWrite| w.in_place_of.is_none() || updated_in_place(body, state.next, state.carried);
    !claimed.contains(&state.next) && write.is_some_and(own)
}

/// Whether `next` is `carried`, updated in place by one pass after another.
fn updated_in_place(body: &[Op], next: ResourceId, carried: ResourceId) -> bool {
    let mut at = next;
    loop {
        let write = body.iter().find_map(|op| match op {
            Op::Pass(p) => p.writes.iter().find(|w| w.resource == at),
            Op::Loop(_) => None,
        });
        match write.and_then(|w| w.in_place_of) {
            Some(old) if old == carried => return true,
            Some(old) => at = old,
            None => return false,
        }
    }
}

/// Every value that the drafts bind.
fn used(drafts: &[Draft]) -> Vec<ValueId> {
    let mut all = Vec::new();
    for draft in drafts {
        match draft {
            Draft::Run(run) => all.extend(&run.slots),
            Draft::Repeat(r) => [&r.first, &r.odd, &r.even].into_iter().for_each(|d| all.extend(used(d))),
            Draft::Tiles(t) => all.extend(used(&t.body)),
        }
    }
    all.sort_unstable();
    all.dedup();
    all
}

/// A pass that copies one resource into another of the same shape.
fn copy_pass(l: &LoopOp, from: ResourceId, to: ResourceId, ops: &Ops) -> KernelPass {
    let shape = ops.shape(to);
    let (entry, reach, text) = match shape {
        Shape::Image(_) => (Entry::Point, Reach::Point, "fn apply(source: vec4f) -> vec4f { return source; }".to_owned()),
        Shape::Volume(_) => (Entry::At, Reach::Point, "fn at(xyz: vec3i) -> vec4f { return load_source(xyz); }".to_owned()),
        Shape::Scalar => (Entry::At, Reach::Whole, "fn at(i: i32) -> vec4f { return load_source(); }".to_owned()),
        Shape::Table { element: pipe_graph::types::Element::F32, .. } => {
            (Entry::At, Reach::Whole, "fn at(i: i32) -> f32 { return load_source(i); }".to_owned())
        }
        Shape::Table { .. } | Shape::Words { .. } | Shape::Pixels { .. } => {
            (Entry::At, Reach::Whole, "fn at(i: i32) -> u32 { return load_source(i); }".to_owned())
        }
    };
    let port = StagePort {
        name: "source".into(),
        source: Source::Read(0),
        shape,
        reach,
        once: true,
        border: pipe_graph::pass::Border::Clamp,
        filter: pipe_graph::pass::Filter::Nearest,
    };
    let stage = Stage {
        shader: Shader::builtin("io/copy.wgsl", &text),
        entry,
        constants: indexmap::IndexMap::new(),
        params: indexmap::IndexMap::<String, Value>::new(),
        ports: vec![port],
        values: Values::Read,
        shape,
    };
    let write = PassWrite { stage: 0, port: "out".into(), resource: to, access: Access::Store, in_place_of: None };
    KernelPass {
        name: format!("{}.hand-over", l.name),
        nodes: vec![l.node],
        stages: vec![stage],
        reads: vec![from],
        writes: vec![write],
        grid: Grid::Cover,
    }
}

/// Turns drafts into steps.
struct Writer<'a> {
    ops: &'a Ops,
    slot_of: &'a [SlotId],
    uniforms: Vec<u8>,
    bytes_moved: u64,
    /// The launches of the body that is being written, where that is one of tiles.
    launched: Option<Vec<Launched>>,
}

/// A launch of a tile's body, with what differs from tile to tile.
struct Launched {
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
    fn steps(&mut self, drafts: Vec<Draft>) -> Vec<Step> {
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

#[cfg(test)]
mod tests {
    use pipe_graph::types::ImageType;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

        /// No two values that live at the same moment share a slot, and of each storage there are as many slots as values that
        /// live at once.
        #[test]
        fn slots_are_shared_by_values_that_do_not_meet(intervals in prop::collection::vec((0_usize..60, 0_usize..12, 0_u32..3), 1..60)) {
            let storage = |n: u32| Storage::Image(ImageType::new([8 << n, 8], 4));
            let one = |(from, steps, n): &(usize, usize, u32)| {
                Held { resource: ResourceId(0), storage: storage(*n), from: *from, to: from + steps }
            };
            let held: Vec<Held> = intervals.iter().map(one).collect();
            let (slot_of, slots) = colour(&held, true);
            for (i, a) in held.iter().enumerate() {
                prop_assert_eq!(slots[slot_of[i].0 as usize].storage, a.storage);
                for (j, b) in held.iter().enumerate().skip(i + 1) {
                    prop_assert!(slot_of[i] != slot_of[j] || a.to < b.from || b.to < a.from);
                }
            }
            for n in 0..3 {
                let alive = |t: usize| held.iter().filter(|h| h.storage == storage(n) && (h.from..=h.to).contains(&t)).count();
                let most = (0..72).map(alive).max().unwrap_or(0);
                prop_assert_eq!(slots.iter().filter(|s| s.storage == storage(n)).count(), most);
            }
        }
    }
}
