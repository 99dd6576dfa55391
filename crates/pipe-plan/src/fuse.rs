//! Fewer passes: producers are put into the kernels of their consumers.
//!
//! A pass P may be put into a pass C that reads its result r when
//!
//! - P computes pixel by pixel (`Point`) with a single result, and only C needs r (it is neither fetched, kept, a loop's
//!   state, nor read elsewhere): so r need never exist;
//! - C reads r at few places for each pixel that it makes: the same one (`Point`), or a small neighbourhood when P costs
//!   next to nothing, or loads each place once, as a reduction does. What a row of taps would recompute again and again is
//!   better stored once;
//! - r is stored in full precision: a half-float image that the user asked for rounds its values, and goes on to;
//! - the kernel stays within the device's bindings.
//!
//! A value that few passes need, each at the same pixel, is computed in each of them when that moves fewer bytes than
//! storing it: the pixels of a file are decoded again rather than kept as floats.
//!
//! Point passes that share an input, or that feed several Point passes, are put side by side into one kernel with
//! several outputs, when no way leads from one to the other through a pass outside. So chains, trees and diamonds of
//! point passes become one kernel, decoding of a file joins what first uses the pixels, and packing for a file joins
//! what made them.
//!
//! Reductions (`Fold`) that walk the same image share one walk, and so one read, when neither needs what the other leads
//! to; what makes the image is then computed inside it.
//!
//! Equal passes over equal inputs are computed once. Every decision is recorded for `pipe plan --after fuse`.

mod folds;

use std::collections::{BTreeMap, BTreeSet};

use pipe_graph::pass::{Access, Count, Entry, Grid, Limits, Reach, ResourceId, Shape};
use pipe_graph::types::Precision;

use crate::kernel_pass::{KernelPass, LoopOp, Op, Ops, Source, Stage};
use folds::is_fold;

/// Most loads that a stencil may make of a value that is computed anew for each.
const MOST_TAPS: u32 = 9;

/// Most consumers that compute a value anew, each for itself, and most stages that they repeat.
const MOST_COPIES: u64 = 3;
const MOST_REPEATED: usize = 2;

/// Most stages of one kernel: beyond, registers run out before bandwidth does.
const MOST_STAGES: usize = 24;

/// What is spared where a value may be stored or computed again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Thrift {
    /// Bytes moved.
    Bytes,
    /// Bytes held: values computed from few pixels are never stored.
    Memory,
}

/// Fuses every region.
pub(crate) fn fuse(mut ops: Ops, limits: &Limits, thrift: Thrift) -> (Ops, Vec<String>) {
    let mut log = Vec::new();
    let wanted: BTreeSet<ResourceId> = ops.wanted().collect();
    let list = std::mem::take(&mut ops.ops);
    let list = region(list, &ops, &wanted, (limits, thrift), &mut log);
    ops.ops = list;
    (ops, log)
}

fn region(list: Vec<Op>, ops: &Ops, outside: &BTreeSet<ResourceId>, how: (&Limits, Thrift), log: &mut Vec<String>) -> Vec<Op> {
    let inner = |l: LoopOp, log: &mut Vec<String>| {
        let mut needed: BTreeSet<ResourceId> = l.states.iter().flat_map(|s| [s.next, s.carried]).collect();
        if let Count::Until { value, .. } = l.count {
            needed.insert(value);
        }
        LoopOp { body: region(l.body, ops, &needed, how, log), ..l }
    };
    let list: Vec<Op> = list
        .into_iter()
        .map(|op| match op {
            Op::Loop(l) => Op::Loop(inner(l, log)),
            pass @ Op::Pass(_) => pass,
        })
        .collect();
    let (limits, thrift) = how;
    let mut fusion = Fusion { list: share_equal(list, outside, log), ops, outside, limits, thrift, log, said: BTreeSet::new() };
    // Reductions come together before each would take a copy of the image's producer in.
    fusion.everywhere(Fusion::join_folds);
    fusion.everywhere(Fusion::fold);
    fusion.everywhere(Fusion::join_folds);
    fusion.everywhere(Fusion::fold_into_all);
    fusion.everywhere(Fusion::fold);
    fusion.everywhere(Fusion::join);
    // What was joined may have become foldable.
    fusion.everywhere(Fusion::fold);
    fusion.everywhere(Fusion::join_folds);
    fusion.list
}

/// Equal passes over equal inputs become one.
fn share_equal(list: Vec<Op>, outside: &BTreeSet<ResourceId>, log: &mut Vec<String>) -> Vec<Op> {
    let mut renamed: BTreeMap<ResourceId, ResourceId> = BTreeMap::new();
    let mut kept: Vec<Op> = Vec::with_capacity(list.len());
    // Of what is overwritten, everyone needs a copy of their own.
    let overwritten: BTreeSet<ResourceId> = list.iter().flat_map(Op::takes_over).collect();
    let lasts = |pass: &KernelPass| pass.writes.iter().all(|w| w.in_place_of.is_none() && !overwritten.contains(&w.resource));
    for mut op in list {
        op.rename(&renamed);
        if let Op::Pass(pass) = &op {
            let free = lasts(pass) && pass.writes.iter().all(|w| !outside.contains(&w.resource));
            let twin = kept.iter().find_map(|other| match other {
                Op::Pass(other) if free && lasts(other) && same_work(pass, other) => Some(other),
                _ => None,
            });
            if let Some(twin) = twin {
                log.push(format!("{} is {} once more: computed once", pass.name, twin.name));
                for (w, t) in pass.writes.iter().zip(&twin.writes) {
                    renamed.insert(w.resource, t.resource);
                }
                continue;
            }
        }
        kept.push(op);
    }
    kept
}

fn same_work(a: &KernelPass, b: &KernelPass) -> bool {
    let ports = |p: &KernelPass| -> Vec<(String, Access)> { p.writes.iter().map(|w| (w.port.clone(), w.access)).collect() };
    a.stages == b.stages && a.reads == b.reads && a.grid == b.grid && ports(a) == ports(b)
}

struct Fusion<'a> {
    list: Vec<Op>,
    ops: &'a Ops,
    outside: &'a BTreeSet<ResourceId>,
    limits: &'a Limits,
    thrift: Thrift,
    log: &'a mut Vec<String>,
    /// What the log says.
    said: BTreeSet<String>,
}

impl Fusion<'_> {
    fn pass(&self, i: usize) -> Option<&KernelPass> {
        match &self.list[i] {
            Op::Pass(p) => Some(p),
            Op::Loop(_) => None,
        }
    }

    /// Applies a step at every operation until it changes nothing. A step that succeeds takes the operation away, so the
    /// next one has its place.
    fn everywhere(&mut self, step: fn(&mut Self, usize) -> bool) {
        let mut changed = true;
        while changed {
            changed = false;
            let mut at = 0;
            while at < self.list.len() {
                if step(self, at) {
                    changed = true;
                } else {
                    at += 1;
                }
            }
        }
    }

    /// Operations behind one that need a resource.
    fn readers(&self, behind: usize, id: ResourceId) -> Vec<usize> {
        let reads = |op: &Op| match op {
            Op::Pass(pass) => pass.sources().any(|source| source == id),
            Op::Loop(_) => op.sources().contains(&id),
        };
        (behind + 1..self.list.len()).filter(|i| reads(&self.list[*i])).collect()
    }

    /// Puts producer `p` into its only consumer, if that may be.
    fn fold(&mut self, p: usize) -> bool {
        let Some(producer) = self.pass(p) else { return false };
        let Some(result) = foldable(producer, self.ops) else { return false };
        if self.outside.contains(&result) {
            return false;
        }
        let [c] = self.readers(p, result)[..] else { return false };
        let Some(consumer) = self.pass(c) else { return false };
        let may = if self.overwritten(p, c) {
            Err("what it reads is overwritten between".to_owned())
        } else {
            self.may_fold(producer, consumer, result)
        };
        let fused = match may {
            Ok(()) => fold(producer, consumer, result),
            Err(why) => {
                let note = format!("{} stays before {}: {why}", producer.name, consumer.name);
                self.note(note);
                return false;
            }
        };
        if !within_limits(&fused, self.ops, self.limits) {
            let note = format!("{} stays before {}: together they bind more than the device allows", producer.name, consumer.name);
            self.note(note);
            return false;
        }
        self.note(format!("{} is computed inside {}", producer.name, consumer.name));
        self.list[c] = Op::Pass(fused);
        self.list.remove(p);
        true
    }

    /// Puts producer `p` into each of its few consumers, where computing it anew moves no more bytes than storing it and
    /// loading it again.
    fn fold_into_all(&mut self, p: usize) -> bool {
        let Some(producer) = self.pass(p) else { return false };
        let Some(result) = foldable(producer, self.ops) else { return false };
        let (most_stages, most_copies) = match self.thrift {
            Thrift::Bytes => (MOST_REPEATED, MOST_COPIES),
            Thrift::Memory => (MOST_STAGES / 2, u64::MAX),
        };
        if self.outside.contains(&result) || producer.stages.len() > most_stages {
            return false;
        }
        let readers = self.readers(p, result);
        let copies = readers.len() as u64;
        let read: u64 = producer.reads.iter().map(|r| self.ops.shape(*r).bytes()).sum();
        let stored = self.ops.shape(result).bytes();
        let moves_more = self.thrift == Thrift::Bytes && copies * read > read + stored + copies * stored;
        if !(2..=most_copies).contains(&copies) || moves_more {
            return false;
        }
        let fused = |c: &usize| {
            let consumer = self.pass(*c)?;
            let may = taps(consumer, result) == Ok(1) && !self.overwritten(p, *c) && self.may_fold(producer, consumer, result).is_ok();
            may.then(|| fold(producer, consumer, result)).filter(|fused| within_limits(fused, self.ops, self.limits))
        };
        let Some(fused) = readers.iter().map(fused).collect::<Option<Vec<_>>>() else { return false };
        let names: Vec<_> = readers.iter().filter_map(|c| self.pass(*c)).map(|c| c.name.clone()).collect();
        self.note(format!("{} is computed inside {}: that moves fewer bytes than storing it", producer.name, names.join(" and ")));
        for (c, pass) in readers.into_iter().zip(fused) {
            self.list[c] = Op::Pass(pass);
        }
        self.list.remove(p);
        true
    }

    fn note(&mut self, text: String) {
        if self.said.insert(text.clone()) {
            self.log.push(text);
        }
    }

    fn may_fold(&self, producer: &KernelPass, consumer: &KernelPass, result: ResourceId) -> Result<(), String> {
        if producer.stages.len() + consumer.stages.len() > MOST_STAGES {
            return Err("the kernel would be too long".into());
        }
        if matches!(self.ops.shape(result), Shape::Image(t) if t.precision == Precision::F16) {
            return Err("it is stored in half precision, which rounds".into());
        }
        if consumer.last().entry == Entry::Points {
            return Err("points are drawn from stored images".into());
        }
        let taps = taps(consumer, result)?;
        // Ports apply their border before they ask for a value, so a producer is never asked for one outside.
        // Decoding a file's words or looking into a table is not next to nothing.
        let ports = || producer.stages.iter().flat_map(|s| &s.ports);
        let cheap = ports().count() <= 1 && ports().all(|p| matches!(p.shape, Shape::Image(_)));
        if taps > 1 && (taps > MOST_TAPS || !cheap) {
            return Err(format!("it would be computed {taps} times for each pixel"));
        }
        Ok(())
    }

    /// Puts Point pass `a` beside a later one over the same grid, when they share an input or one feeds the other.
    fn join(&mut self, a: usize) -> bool {
        let Some(first) = self.pass(a).filter(|pass| is_points(pass)) else { return false };
        let half = first.writes.iter().any(|w| matches!(self.ops.shape(w.resource), Shape::Image(t) if t.precision == Precision::F16));
        let image = |r: &ResourceId| matches!(self.ops.shape(*r), Shape::Image(_));
        for b in a + 1..self.list.len() {
            let Some(second) = self.pass(b) else { continue };
            if !is_points(second) || first.last().shape_size() != second.last().shape_size() {
                continue;
            }
            let feeds = second.reads.iter().any(|r| first.writes.iter().any(|w| w.resource == *r));
            let shares = first.reads.iter().any(|r| image(r) && second.reads.contains(r));
            if !(feeds || shares) || (feeds && half) || first.stages.len() + second.stages.len() > MOST_STAGES {
                continue;
            }
            // It will stand where the second stood: everything that the second needs is there.
            if self.held_up(a, b) {
                continue;
            }
            let joined = join(first, second);
            if within_limits(&joined, self.ops, self.limits) {
                self.note(format!("{} and {} run in one kernel", first.name, second.name));
                self.list[b] = Op::Pass(joined);
                self.list.remove(a);
                return true;
            }
        }
        false
    }

    /// Whether something behind `a`, up to `b`, takes over the storage of what `a` reads.
    fn overwritten(&self, a: usize, b: usize) -> bool {
        let read = self.list[a].sources();
        (a + 1..=b).any(|i| self.list[i].takes_over().iter().any(|id| read.contains(id)))
    }

    /// Whether something between `a` and `b` must come behind `a`, so that `a` cannot move to `b`.
    fn held_up(&self, a: usize, b: usize) -> bool {
        (a + 1..b).any(|i| self.list[i].comes_behind(&self.list[a]))
    }
}

/// At how many places a pass loads a value for each that it makes (or that there is, when it loads each once).
fn taps(consumer: &KernelPass, result: ResourceId) -> Result<u32, String> {
    let at = consumer.reads.iter().position(|r| *r == result).ok_or("it is read by a parameter only")?;
    if is_fold(consumer) {
        // However many folds take a pixel, it is loaded once.
        return Ok(1);
    }
    consumer.stages.iter().flat_map(|s| &s.ports).filter(|p| p.source == Source::Read(at)).try_fold(0_u32, |taps, port| {
        let more = match port.reach {
            Reach::Point => 1,
            Reach::Around(x, y) => (2 * x + 1).saturating_mul(2 * y + 1),
            Reach::Whole if port.once => 1,
            Reach::Elsewhere(_) => return Err("it is read at other places".to_owned()),
            Reach::Whole => return Err("it is read from anywhere".to_owned()),
        };
        Ok(taps.saturating_add(more))
    })
}

/// Whether a pass is made of Point stages only.
fn is_points(pass: &KernelPass) -> bool {
    pass.grid == Grid::Cover
        && pass.stages.iter().all(|s| s.entry == Entry::Point)
        && pass.writes.iter().all(|w| w.access == Access::Store && w.in_place_of.is_none())
}

/// The single image that a Point pass makes.
fn foldable(pass: &KernelPass, ops: &Ops) -> Option<ResourceId> {
    match pass.writes.as_slice() {
        [one] if is_points(pass) && matches!(ops.shape(one.resource), Shape::Image(_)) => Some(one.resource),
        _ => None,
    }
}

/// The consumer with the producer's stages in front.
fn fold(producer: &KernelPass, consumer: &KernelPass, result: ResourceId) -> KernelPass {
    let mut fused = stack(producer, consumer);
    let offset = producer.stages.len();
    let value = producer.writes[0].stage;
    let at = fused.reads.iter().position(|r| *r == result);
    for stage in &mut fused.stages[offset..] {
        for port in &mut stage.ports {
            if at.is_some_and(|at| port.source == Source::Read(at)) {
                port.source = Source::Stage(value);
            }
        }
    }
    fused.writes.retain(|w| w.resource != result);
    drop_unread(&mut fused);
    fused.grid = consumer.grid;
    fused.name = join_names(&producer.name, &consumer.name);
    fused
}

/// Both passes in one kernel; what the first makes and the second reads is passed on directly.
fn join(first: &KernelPass, second: &KernelPass) -> KernelPass {
    let mut joined = stack(first, second);
    let offset = first.stages.len();
    for write in &first.writes {
        let Some(at) = joined.reads.iter().position(|r| *r == write.resource) else { continue };
        for stage in &mut joined.stages[offset..] {
            for port in &mut stage.ports {
                if port.source == Source::Read(at) {
                    port.source = Source::Stage(write.stage);
                }
            }
        }
    }
    share_stages(&mut joined);
    drop_unread(&mut joined);
    joined.name = join_names(&first.name, &second.name);
    joined
}

/// Takes Point stages away that compute what an earlier one computes, as when both passes decode the same file.
fn share_stages(pass: &mut KernelPass) {
    let mut kept: Vec<Stage> = Vec::new();
    let mut place: Vec<usize> = Vec::new();
    for (s, mut stage) in std::mem::take(&mut pass.stages).into_iter().enumerate() {
        for port in &mut stage.ports {
            if let Source::Stage(k) = &mut port.source {
                *k = place[*k];
            }
        }
        let stored = pass.writes.iter().any(|w| w.stage == s);
        let twin = kept.iter().position(|other| !stored && stage.entry == Entry::Point && *other == stage);
        place.push(twin.unwrap_or(kept.len()));
        if twin.is_none() {
            kept.push(stage);
        }
    }
    pass.stages = kept;
    for write in &mut pass.writes {
        write.stage = place[write.stage];
    }
}

fn join_names(a: &str, b: &str) -> String {
    format!("{a}+{b}")
}

/// The stages of both, reads made distinct, writes of both.
fn stack(first: &KernelPass, second: &KernelPass) -> KernelPass {
    let mut reads = first.reads.clone();
    let offset = first.stages.len();
    let mut stages = first.stages.clone();
    for stage in &second.stages {
        let mut stage = stage.clone();
        for port in &mut stage.ports {
            port.source = match port.source {
                Source::Stage(k) => Source::Stage(k + offset),
                Source::Read(r) => {
                    let id = second.reads[r];
                    Source::Read(reads.iter().position(|known| *known == id).unwrap_or_else(|| {
                        reads.push(id);
                        reads.len() - 1
                    }))
                }
            };
        }
        stages.push(stage);
    }
    let mut writes = first.writes.clone();
    writes.extend(second.writes.iter().cloned().map(|mut w| {
        w.stage += offset;
        w
    }));
    let mut nodes = first.nodes.clone();
    nodes.extend(second.nodes.iter().filter(|n| !first.nodes.contains(n)));
    KernelPass { name: String::new(), nodes, stages, reads, writes, grid: second.grid }
}

/// Takes reads away that no port loads any more.
fn drop_unread(pass: &mut KernelPass) {
    let used: Vec<bool> =
        (0..pass.reads.len()).map(|r| pass.stages.iter().flat_map(|s| &s.ports).any(|p| p.source == Source::Read(r))).collect();
    let place: Vec<usize> = used
        .iter()
        .scan(0, |n, u| {
            let at = *n;
            *n += usize::from(*u);
            Some(at)
        })
        .collect();
    for port in pass.stages.iter_mut().flat_map(|s| &mut s.ports) {
        if let Source::Read(r) = &mut port.source {
            *r = place[*r];
        }
    }
    let mut keep = used.into_iter();
    pass.reads.retain(|_| keep.next().unwrap_or(true));
}

/// Whether a device can bind everything that a pass names.
fn within_limits(pass: &KernelPass, ops: &Ops, limits: &Limits) -> bool {
    let count = |ids: &mut dyn Iterator<Item = ResourceId>, image: bool| {
        ids.filter(|id| matches!(ops.shape(*id), Shape::Image(_) | Shape::Volume(_)) == image).count() as u32
    };
    let sampled = count(&mut pass.reads.iter().copied(), true);
    let stored = count(&mut pass.writes.iter().map(|w| w.resource), true);
    let mut buffers: Vec<ResourceId> = pass.drivers().collect();
    buffers.sort_unstable();
    buffers.dedup();
    let buffers =
        buffers.len() as u32 + count(&mut pass.reads.iter().copied(), false) + count(&mut pass.writes.iter().map(|w| w.resource), false);
    sampled <= limits.max_sampled_images && stored <= limits.max_storage_images && buffers <= limits.max_storage_buffers
}
