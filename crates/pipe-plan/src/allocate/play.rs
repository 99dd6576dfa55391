//! The schedule, played through: which value every step reads and writes, and from when to when each is alive.

use std::collections::{BTreeMap, BTreeSet};

use pipe_graph::pass::{Access, Count, Entry, Grid, Origin, Reach, ResourceId, Shader, Shape, State, Value, Values};

use super::{Draft, Held, Names, RepeatDraft, RunDraft, TilesDraft, ValueId, storage};
use crate::PlanError;
use crate::compose::Composer;
use crate::kernel_pass::{KernelPass, LoopOp, Op, Ops, PassWrite, Source, Stage, StagePort, TilingOp};
use crate::window::Windows;

/// Plays the schedule through.
pub(super) struct Player<'a> {
    pub(super) ops: &'a Ops,
    pub(super) composer: Composer<'a>,
    /// How many operations read a resource, with one more when it must stay.
    pub(super) readers: BTreeMap<ResourceId, usize>,
    /// What some pass takes over the storage of, as the initial value of a state too.
    pub(super) overwritten: BTreeSet<ResourceId>,
    /// What was there before the loop whose body is being played, which every iteration finds as it was.
    pub(super) lasting: Vec<ValueId>,
    pub(super) held: Vec<Held>,
    /// The current step; 0 is before the first.
    pub(super) time: usize,
    /// Of the tiles that are being played.
    pub(super) windows: Option<&'a Windows>,
}

impl<'a> Player<'a> {
    /// A new value of this resource's storage.
    pub(super) fn begin(&mut self, id: ResourceId, from: usize) -> ValueId {
        let storage = storage(self.ops.shape(id), self.composer.limits());
        self.held.push(Held { resource: id, storage, from, to: from });
        ValueId(self.held.len() - 1)
    }

    fn touch(&mut self, value: ValueId) {
        let held = &mut self.held[value.0];
        held.to = held.to.max(self.time);
    }

    pub(super) fn region(&mut self, list: &[Op], names: &mut Names) -> Result<Vec<Draft>, PlanError> {
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
    pub(super) fn tiles(&mut self, tiling: &'a TilingOp, names: &mut Names) -> Result<Draft, PlanError> {
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
pub(super) fn updated_in_place(body: &[Op], next: ResourceId, carried: ResourceId) -> bool {
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
