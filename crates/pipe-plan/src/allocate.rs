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

use std::collections::BTreeMap;

use pipe_graph::pass::{Access, Count, Entry, Grid, Limits, Origin, Reach, ResourceId, Shader, Shape, Value};
use pipe_graph::types::Precision;

use crate::compose::{Composed, Composer};
use crate::kernel_pass::{KernelPass, LoopOp, Op, Ops, PassWrite, Source, Stage, StagePort};
use crate::plan::{Fetched, History, Plan, Repeat, Run, Slot, SlotId, Step, Storage, Times, Upload};
use crate::schedule::Schedule;
use crate::{Options, PlanError};

/// What a device of unknown memory is taken to have when it is about keeping results.
const ASSUMED_BUDGET: u64 = 4 << 30;

/// Index of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct ValueId(usize);

/// One content of storage, from the step that writes it to the last step that reads it.
struct Held {
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

/// Makes the plan.
pub(crate) fn allocate(name: &str, schedule: Schedule, limits: &Limits, options: &Options) -> Result<Plan, PlanError> {
    let ops = schedule.ops;
    let readers = readers(&ops);
    let mut player = Player { ops: &ops, composer: Composer::new(limits, &ops), readers, held: Vec::new(), time: 1 };
    let mut names = Names::new();
    // Literals, uploads and recalled history are there before the first step.
    let mut given: Vec<ResourceId> = Vec::new();
    for op in &ops.ops {
        given.extend(op.sources());
    }
    given.extend(ops.wanted());
    given.sort_unstable();
    given.dedup();
    given.retain(|id| !matches!(ops.resources[id.index()].origin, Origin::Pass | Origin::State));
    for id in &given {
        names.insert(*id, player.begin(*id, 0));
    }
    let drafts = player.region(&ops.ops, &mut names)?;
    let end = player.time + 1;
    for id in ops.wanted() {
        player.held[names[&id].0].to = end;
    }
    let Player { composer, held, .. } = player;
    let naive_bytes = held.iter().map(|h| h.storage.bytes()).sum();
    let share = !options.keep || naive_bytes > options.budget.or(limits.budget).unwrap_or(ASSUMED_BUDGET) / 2;
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

    let mut writer = Writer { ops: &ops, slot_of: &slot_of, uniforms: Vec::new(), bytes_moved: 0 };
    let steps = writer.steps(drafts);
    let peak_bytes = slots.iter().map(|s| s.storage.bytes()).sum();
    check(&ops, &held, &slots, limits, options)?;
    Ok(Plan {
        name: name.to_owned(),
        limits: *limits,
        slots,
        kernels: composer.finish()?,
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

/// How many operations read each resource; what must stay has one reader more.
fn readers(ops: &Ops) -> BTreeMap<ResourceId, usize> {
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
    walk(&ops.ops, &mut count);
    ops.wanted().for_each(|id| *count.entry(id).or_default() += 1);
    count
}

/// The resource that recalls a history, when some pass reads it.
fn recalled(ops: &Ops, given: &[ResourceId], wanted: &str) -> Option<ResourceId> {
    let of_history = |id: &&ResourceId| matches!(&ops.resources[id.index()].origin, Origin::History { name, .. } if name == wanted);
    given.iter().find(of_history).copied()
}

/// Refuses what cannot run before anything is allocated.
fn check(ops: &Ops, held: &[Held], slots: &[Slot], limits: &Limits, options: &Options) -> Result<(), PlanError> {
    for r in &ops.resources {
        match r.shape {
            Shape::Image(t) if t.size.iter().any(|n| *n > limits.max_image) => {
                return Err(PlanError::ImageTooLarge { name: r.name.clone(), size: t.size, most: limits.max_image });
            }
            Shape::Volume(t) if t.size.iter().any(|n| *n > limits.max_volume) => {
                return Err(PlanError::VolumeTooLarge { name: r.name.clone(), size: t.size, most: limits.max_volume });
            }
            Shape::Table { .. } | Shape::Words { .. } if r.shape.bytes() > limits.max_binding_bytes => {
                return Err(PlanError::TableTooLarge { name: r.name.clone(), bytes: r.shape.bytes(), most: limits.max_binding_bytes });
            }
            _ => {}
        }
    }
    let needed: u64 = slots.iter().map(|s| s.storage.bytes()).sum();
    match options.budget.or(limits.budget) {
        Some(budget) if needed > budget => {
            let largest = ops.resources.iter().max_by_key(|r| r.shape.bytes()).map(|r| (r.name.clone(), r.shape.bytes()));
            let (name, bytes) = largest.unwrap_or_default();
            Err(PlanError::Budget { needed, budget, alive: held.len(), name, bytes })
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
        Shape::Table { .. } | Shape::Words { .. } | Shape::Scalar => Storage::Buffer { bytes: shape.bytes().next_multiple_of(16).max(16) },
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
    held: Vec<Held>,
    /// The current step; 0 is before the first.
    time: usize,
}

impl Player<'_> {
    /// A new value of this resource's storage.
    fn begin(&mut self, id: ResourceId, from: usize) -> ValueId {
        let storage = storage(self.ops.shape(id), self.composer.limits());
        self.held.push(Held { storage, from, to: from });
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
            if write.in_place_of.is_none() && write.access != Access::Store {
                clears.push(names[&write.resource]);
            }
        }
        let composed = self.composer.compose(pass)?;
        let slots: Vec<ValueId> = composed.resources.iter().map(|id| names[id]).collect();
        for value in &slots {
            self.touch(*value);
        }
        self.time += 1;
        Ok(Draft::Run(RunDraft { pass: pass.clone(), composed, slots, clears }))
    }

    fn repeat(&mut self, l: &LoopOp, names: &mut Names) -> Result<Vec<Draft>, PlanError> {
        let most = match l.count {
            Count::Fixed(n) | Count::Until { max: n, .. } => n,
        };
        // A state that never changes is what it was.
        let (same, changing): (Vec<_>, Vec<_>) = l.states.iter().partition(|s| s.next == s.carried);
        for state in &same {
            names.insert(state.result, names[&state.init]);
            names.insert(state.carried, names[&state.init]);
        }
        if most == 0 {
            for state in &changing {
                names.insert(state.result, names[&state.init]);
            }
            return Ok(Vec::new());
        }
        let mut body = l.body.clone();
        let mut nexts = Vec::new();
        for state in &changing {
            let next = if self.written_for(&body, state.next, &nexts) {
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
        let mut before = Vec::new();
        let mut inits: Vec<ResourceId> = changing.iter().map(|s| s.init).collect();
        for (i, state) in changing.iter().enumerate() {
            let made = matches!(self.ops.resources[state.init.index()].origin, Origin::Pass | Origin::State);
            if in_place[i] && (!made || self.readers.get(&state.init).is_some_and(|n| *n > 1)) {
                let pass = copy_pass(l, state.init, state.carried, self.ops);
                before.push(self.pass(&pass, names)?);
                inits[i] = state.carried;
            }
        }
        let start = self.time;
        let outside: Vec<ValueId> = names.values().copied().collect();
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
        let end = self.time;
        // What the repeated part uses lives until the loop ends, since the loop comes back to it.
        if most > 1 {
            let repeated = used(&odd).into_iter().chain(used(&even));
            for value in repeated {
                if outside.contains(&value) || b.contains(&value) || a.contains(&value) || value_pair.contains(&Some(value)) {
                    self.held[value.0].to = self.held[value.0].to.max(end);
                }
            }
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

    /// Whether a pass of the body writes this resource, and no other state claims it already.
    fn written_for(&self, body: &[Op], next: ResourceId, claimed: &[ResourceId]) -> bool {
        !claimed.contains(&next) && body.iter().any(|op| matches!(op, Op::Pass(p) if p.writes.iter().any(|w| w.resource == next)))
    }
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
        Shape::Table { .. } | Shape::Words { .. } => {
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
}

impl Writer<'_> {
    fn steps(&mut self, drafts: Vec<Draft>) -> Vec<Step> {
        let one = |draft| match draft {
            Draft::Run(run) => Step::Run(self.run(run)),
            Draft::Repeat(r) => Step::Repeat(self.repeat(r)),
        };
        drafts.into_iter().map(one).collect()
    }

    fn run(&mut self, draft: RunDraft) -> Run {
        let RunDraft { pass, composed, slots, clears } = draft;
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
        Run {
            name: pass.name.clone(),
            nodes: pass.nodes.iter().map(|n| self.ops.nodes[n.0 as usize].clone()).collect(),
            kernel: composed.kernel,
            slots: slots.iter().map(|v| self.slot_of[v.0]).collect(),
            uniform_offset,
            groups: composed.groups,
            clears: clears.iter().map(|v| self.slot_of[v.0]).collect(),
            bytes,
            reads: reads.iter().map(name).collect(),
            writes: writes.iter().map(name).collect(),
        }
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
