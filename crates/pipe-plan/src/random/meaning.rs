//! What every resource is, as a number: the hash of all that was done to get it.
//!
//! Two resources have the same number when the same shaders made them from the same things, wherever the work was done: the
//! value of a stage that another one asks is the value that it would have loaded, so fusing must not change any number. Half
//! precision rounds, which is work too.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use pipe_graph::pass::{Access, Constant, Count, Entry, Origin, Resource, ResourceId, Shape, Value};
use pipe_graph::types::Precision;

use crate::kernel_pass::{KernelPass, LoopOp, Op, Ops, Source, Stage};

/// The numbers of resources.
pub(super) type Numbers = BTreeMap<ResourceId, u64>;

/// The number of zeros.
pub(super) const ZERO: u64 = 0;

pub(super) fn hash(of: impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    of.hash(&mut hasher);
    hasher.finish()
}

/// How often a loop of unknown length runs: as often as it may, or until its first check.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ending {
    Latest,
    FirstCheck,
}

impl Ending {
    pub(super) fn times(self, every: u32, max: u32) -> u32 {
        match self {
            Self::Latest => max,
            Self::FirstCheck => every.min(max),
        }
    }
}

/// The number of something that no pass makes.
pub(super) fn given(resource: &Resource) -> u64 {
    match &resource.origin {
        Origin::External { name, ranges } => hash(("external", name, ranges)),
        Origin::Literal(bytes) => hash(("literal", bytes)),
        Origin::History { name, delay } => hash(("history", name, delay)),
        Origin::Pass | Origin::State => unreachable!("made by a pass"),
    }
}

/// By the names of loops of unknown length: all that was checked to end them.
pub(super) type Checks = BTreeMap<String, u64>;

pub(super) fn note_check(checks: &mut Checks, name: &str, checked: u64) {
    let all = checks.entry(name.to_owned()).or_default();
    *all = hash((*all, checked));
}

/// What everything is when all has run.
pub(super) struct Meaning {
    pub(super) numbers: Numbers,
    pub(super) checks: Checks,
}

impl Meaning {
    pub(super) fn of(ops: &Ops, list: &[Op], ending: Ending) -> Self {
        let there = (0..).map(ResourceId).zip(&ops.resources).filter(|(_, r)| !matches!(r.origin, Origin::Pass | Origin::State));
        let numbers = there.map(|(id, r)| (id, given(r))).collect();
        let mut meaning = Self { numbers, checks: Checks::new() };
        meaning.region(ops, list, ending);
        meaning
    }

    fn region(&mut self, ops: &Ops, list: &[Op], ending: Ending) {
        for op in list {
            match op {
                Op::Pass(pass) => {
                    let numbers = &self.numbers;
                    let before = |w: usize| pass.writes[w].in_place_of.map_or(ZERO, |old| numbers[&old]);
                    let made = of_pass(pass, ops, &|id| numbers[&id], &before);
                    self.numbers.extend(pass.writes.iter().map(|w| w.resource).zip(made));
                }
                Op::Loop(l) => self.repeat(ops, l, ending),
            }
        }
    }

    fn repeat(&mut self, ops: &Ops, l: &LoopOp, ending: Ending) {
        let mut states: Vec<u64> = l.states.iter().map(|s| self.numbers[&s.init]).collect();
        let times = match l.count {
            Count::Fixed(n) => n,
            Count::Until { every, max, .. } => ending.times(every, max),
        };
        for _ in 0..times {
            self.numbers.extend(l.states.iter().map(|s| s.carried).zip(states));
            self.region(ops, &l.body, ending);
            if let Count::Until { value, .. } = l.count {
                note_check(&mut self.checks, &l.name, self.numbers[&value]);
            }
            states = l.states.iter().map(|s| self.numbers[&s.next]).collect();
        }
        self.numbers.extend(l.states.iter().map(|s| s.result).zip(states));
    }
}

/// The numbers of what a pass writes, from those of what it reads and of what lay there before.
pub(super) fn of_pass(pass: &KernelPass, ops: &Ops, read: &dyn Fn(ResourceId) -> u64, before: &dyn Fn(usize) -> u64) -> Vec<u64> {
    let mut stages: Vec<u64> = Vec::with_capacity(pass.stages.len());
    for stage in &pass.stages {
        stages.push(of_stage(
            stage,
            &|source| match source {
                Source::Read(r) => read(pass.reads[r]),
                Source::Stage(k) => stages[k],
            },
            read,
        ));
    }
    let one = |(i, write): (usize, &crate::kernel_pass::PassWrite)| {
        let stage = &pass.stages[write.stage];
        let value = if stage.entry == Entry::Point {
            stages[write.stage]
        } else {
            let adds_to = write.access != Access::Store || write.in_place_of.is_some();
            let before = adds_to.then(|| before(i));
            hash((stages[write.stage], &write.port, format!("{:?}{:?}", write.access, pass.grid), before))
        };
        let half = matches!(ops.shape(write.resource), Shape::Image(t) if t.precision == Precision::F16);
        if half { hash(("half", value)) } else { value }
    };
    pass.writes.iter().enumerate().map(one).collect()
}

fn of_stage(stage: &Stage, value: &dyn Fn(Source) -> u64, read: &dyn Fn(ResourceId) -> u64) -> u64 {
    let mut hasher = DefaultHasher::new();
    (&stage.shader, stage.entry, stage.shape).hash(&mut hasher);
    for (name, constant) in &stage.constants {
        let bits = match constant {
            Constant::U32(v) => *v,
            other => unreachable!("no random graph has {other:?}"),
        };
        (name, bits).hash(&mut hasher);
    }
    for (name, param) in &stage.params {
        let number = match param {
            Value::F32(v) => u64::from(v.to_bits()),
            Value::Driven(id) => read(*id),
            other => unreachable!("no random graph has {other:?}"),
        };
        (name, number).hash(&mut hasher);
    }
    for port in &stage.ports {
        (&port.name, port.shape, port.reach, port.once, port.border, port.filter, value(port.source)).hash(&mut hasher);
    }
    hasher.finish()
}
