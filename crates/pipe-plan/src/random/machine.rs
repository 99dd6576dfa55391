//! A machine that runs a plan on slots that hold numbers.
//!
//! It knows what a launch computes, but not which resource lies where: each reads the numbers that its slots happen to hold
//! and leaves the numbers of its results in those that it writes. What the host takes at the end has the number that the graph
//! gives it only if no slot ever held two live values.

use std::collections::{BTreeMap, BTreeSet};

use pipe_graph::pass::{Access, Entry, ResourceId};

use super::meaning::{self, Checks, Ending, Meaning, ZERO, hash};
use crate::kernel_pass::{KernelPass, Op, Ops, Portion, TilingOp};
use crate::plan::{Binding, Launch, Plan, Repeat, Run, SlotId, Step, Storage, Tiling, Times};
use crate::schedule::Schedule;

/// Of what the host takes: name, part, number.
type Taken = BTreeMap<(String, usize), u64>;

/// What the host sees of a run.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Seen {
    taken: Taken,
    checks: Checks,
}

/// What a graph means to the host.
pub(super) fn expected(ops: &Ops, ending: Ending) -> Seen {
    let Meaning { numbers, checks } = Meaning::of(ops, &ops.ops, ending);
    let part = |f: &pipe_graph::pass::Fetch| -> Vec<_> {
        let parts = f.parts.iter().enumerate();
        parts.map(|(i, (id, _))| ((f.name.clone(), i), numbers[id])).collect()
    };
    let kept = ops.kept.iter().map(|k| ((k.name.clone(), 0), numbers[&k.resource]));
    Seen { taken: ops.fetches.iter().flat_map(part).chain(kept).collect(), checks }
}

impl Seen {
    /// What is not as expected. Loops that nobody needs are not run.
    pub(super) fn unlike(&self, expected: &Self) -> Vec<String> {
        let keys: BTreeSet<_> = self.taken.keys().chain(expected.taken.keys()).collect();
        let taken = keys.into_iter().filter(|key| self.taken.get(*key) != expected.taken.get(*key));
        let checks = self.checks.iter().filter(|(name, checked)| expected.checks.get(*name) != Some(*checked));
        taken.map(|(name, _)| name.clone()).chain(checks.map(|(name, _)| format!("the check of {name}"))).collect()
    }
}

/// What a plan gives the host, and what is wrong with it.
pub(super) fn play(plan: &Plan, schedule: &Schedule, ending: Ending) -> Result<Seen, String> {
    let whole = schedule.portions.iter().filter(|p| matches!(p, Portion::Whole(_)));
    let passes = whole.flat_map(|p| by_name(p.ops())).collect();
    let garbage = (0..plan.slots.len()).map(|i| hash(("garbage", i))).collect();
    let mut machine =
        Machine { plan, ops: &schedule.ops, slots: garbage, passes, tiling: None, later_tile: false, ending, checks: Checks::new() };
    machine.begin();
    let mut taken = Taken::new();
    let mut tilings = schedule.portions.iter().filter_map(Portion::tiling);
    for step in &plan.steps {
        match step {
            Step::Tiles(steps) => machine.tiles(steps, tilings.next().ok_or("a tiling too many")?, &mut taken)?,
            other => machine.steps(std::slice::from_ref(other))?,
        }
    }
    for fetched in &plan.fetches {
        for (i, (slot, _)) in fetched.parts.iter().enumerate() {
            taken.insert((fetched.name.clone(), i), machine.slots[slot.0 as usize]);
        }
    }
    for history in &plan.histories {
        taken.insert((history.name.clone(), 0), machine.slots[history.keep.0 as usize]);
    }
    Ok(Seen { taken, checks: machine.checks })
}

fn by_name(list: &[Op]) -> BTreeMap<&str, &KernelPass> {
    let mut passes = BTreeMap::new();
    for op in list {
        match op {
            Op::Pass(pass) => {
                passes.insert(pass.name.as_str(), pass);
            }
            Op::Loop(l) => passes.extend(by_name(&l.body)),
        }
    }
    passes
}

struct Machine<'a> {
    plan: &'a Plan,
    ops: &'a Ops,
    slots: Vec<u64>,
    passes: BTreeMap<&'a str, &'a KernelPass>,
    tiling: Option<&'a TilingOp>,
    later_tile: bool,
    ending: Ending,
    checks: Checks,
}

impl<'a> Machine<'a> {
    /// What the host does before the first step.
    fn begin(&mut self) {
        for (slot, bytes) in &self.plan.literals {
            self.slots[slot.0 as usize] = hash(("literal", bytes));
        }
        for upload in &self.plan.uploads {
            self.slots[upload.slot.0 as usize] = hash(("external", &upload.name, &upload.ranges));
        }
        for history in &self.plan.histories {
            if let Some(slot) = history.recall {
                self.slots[slot.0 as usize] = hash(("history", &history.name, &history.delay));
            }
        }
    }

    fn steps(&mut self, steps: &[Step]) -> Result<(), String> {
        for step in steps {
            match step {
                Step::Run(run) => self.run(run)?,
                Step::Repeat(repeat) => self.repeat(repeat)?,
                Step::Tiles(t) => return Err(format!("the tiles of {} are inside another step", t.name)),
            }
        }
        Ok(())
    }

    fn repeat(&mut self, repeat: &Repeat) -> Result<(), String> {
        let times = match repeat.count {
            Times::Fixed(n) => n,
            Times::Until { every, max, .. } => self.ending.times(every, max),
        };
        for i in 0..times {
            let steps = match i {
                0 => &repeat.first,
                _ if i % 2 == 1 => &repeat.odd,
                _ => &repeat.even,
            };
            self.steps(steps)?;
            if let Times::Until { value, .. } = repeat.count {
                let checked = self.slots[value[i as usize % 2].0 as usize];
                meaning::note_check(&mut self.checks, &repeat.name, checked);
            }
        }
        if times % 2 == 1 {
            for (from, to) in &repeat.settle {
                self.slots[to.0 as usize] = self.slots[from.0 as usize];
            }
        }
        Ok(())
    }

    /// Three tiles are as good as all: what the first leaves, a second and a third must neither spoil nor need anew.
    fn tiles(&mut self, steps: &Tiling, tiling: &'a TilingOp, taken: &mut Taken) -> Result<(), String> {
        let whole = std::mem::replace(&mut self.passes, by_name(&tiling.body));
        self.tiling = Some(tiling);
        self.clear(&steps.clears);
        for (i, tile) in steps.tiles.iter().take(3).enumerate() {
            self.later_tile = i > 0;
            for (upload, brought) in tile.uploads.iter().zip(&tiling.uploads) {
                let resource = &self.ops.resources[brought.resource.index()];
                self.slots[upload.slot.0 as usize] = meaning::given(resource);
            }
            self.steps(&steps.body)?;
            for fetch in &tile.fetches {
                let number = self.slots[fetch.slot.0 as usize];
                let known = *taken.entry((fetch.name.clone(), fetch.plane as usize)).or_insert(number);
                if known != number {
                    return Err(format!("{} differs from tile to tile", fetch.name));
                }
            }
        }
        self.passes = whole;
        (self.tiling, self.later_tile) = (None, false);
        Ok(())
    }

    fn clear(&mut self, slots: &[SlotId]) {
        for slot in slots {
            self.slots[slot.0 as usize] = ZERO;
        }
    }

    fn run(&mut self, run: &Run) -> Result<(), String> {
        self.check_bindings(run)?;
        self.clear(&run.clears);
        let kernel = &self.plan.kernels[run.kernel.0 as usize];
        if kernel.label == "io/copy.wgsl" {
            self.slots[run.slots[1].0 as usize] = self.slots[run.slots[0].0 as usize];
            return Ok(());
        }
        let pass = *self.passes.get(run.name.as_str()).ok_or_else(|| format!("nobody scheduled {}", run.name))?;
        let labels: Vec<&str> = pass.stages.iter().map(|s| &*s.shader.path).collect();
        if kernel.label != labels.join(" + ") {
            return Err(format!("{} is launched as {}", run.name, kernel.label));
        }
        // Reads, writes, then scalars that drive; the target of points comes last.
        let (reads, writes) = (pass.reads.len(), pass.writes.len());
        let points = pass.last().entry == Entry::Points;
        let first_write = if points { run.slots.len() - writes } else { reads };
        let first_driver = if points { reads } else { reads + writes };
        let mut drivers: Vec<ResourceId> = Vec::new();
        for id in pass.drivers() {
            if !drivers.contains(&id) {
                drivers.push(id);
            }
        }
        let at = |i: usize| run.slots[i].0 as usize;
        let read = |id: ResourceId| {
            let place = pass.reads.iter().position(|r| *r == id);
            let driver = || first_driver + drivers.iter().position(|d| *d == id).expect("it is read");
            self.slots[at(place.unwrap_or_else(driver))]
        };
        let whole = |w: usize| self.tiling.is_some_and(|t| !t.windows.views.contains_key(&pass.writes[w].resource));
        // What later tiles add to is taken to be what the first began with.
        let before = |w: usize| if self.later_tile && whole(w) { ZERO } else { self.slots[at(first_write + w)] };
        let mut made = meaning::of_pass(pass, self.ops, &read, &before);
        for (w, number) in made.iter_mut().enumerate() {
            let (there, new) = (self.slots[at(first_write + w)], pass.writes[w].in_place_of.is_none());
            if self.later_tile && whole(w) && there != *number {
                *number = hash(("what other tiles left is gone", there));
            }
            if !self.later_tile && new && pass.writes[w].access != Access::Store && there != ZERO {
                return Err(format!("{} counts on what is not zero", run.name));
            }
        }
        for (w, number) in made.into_iter().enumerate() {
            self.slots[at(first_write + w)] = number;
        }
        Ok(())
    }

    /// Every slot is made for its binding, and what is written is bound once.
    fn check_bindings(&self, run: &Run) -> Result<(), String> {
        let kernel = &self.plan.kernels[run.kernel.0 as usize];
        let storage = |slot: SlotId| self.plan.slots[slot.0 as usize].storage;
        let bindings: Vec<Binding> = kernel.bindings.iter().copied().filter(|b| b.takes_slot()).collect();
        let target = usize::from(matches!(kernel.launch, Launch::Points(_)));
        if run.slots.len() != bindings.len() + target {
            return Err(format!("{} binds {} slots, its kernel {}", run.name, run.slots.len(), bindings.len()));
        }
        for (i, slot) in run.slots.iter().enumerate() {
            let (fits, written) = match (bindings.get(i), storage(*slot)) {
                (None, Storage::Image(t)) => (kernel.launch == Launch::Points(t), true),
                (Some(Binding::SampledImage), Storage::Image(_)) | (Some(Binding::SampledVolume), Storage::Volume(_)) => (true, false),
                (Some(Binding::StorageImage(t)), Storage::Image(own)) => (own == *t, true),
                (Some(Binding::StorageVolume(t)), Storage::Volume(own)) => (own == *t, true),
                (Some(Binding::ReadBuffer), Storage::Buffer { .. }) => (true, false),
                (Some(Binding::WriteBuffer), Storage::Buffer { .. }) => (true, true),
                _ => (false, false),
            };
            if !fits {
                return Err(format!("{}: slot {} does not fit binding {i}", run.name, slot.0));
            }
            if written && run.slots.iter().filter(|other| *other == slot).count() > 1 {
                return Err(format!("{} writes slot {} and binds it elsewhere", run.name, slot.0));
            }
        }
        Ok(())
    }
}
