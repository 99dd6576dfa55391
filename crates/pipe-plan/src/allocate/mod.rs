//! Slots for resources, and the steps that use them.
//!
//! The schedule is played through once. A *value* is one content of storage over an interval of steps; a resource
//! inside a loop becomes three values, one for each of the copies of the body that [`Repeat`](crate::plan::Repeat) has:
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

mod play;
mod write;

use std::collections::{BTreeMap, BTreeSet};

use pipe_graph::pass::{Count, Limits, Origin, ResourceId, Shape};
use pipe_graph::types::Precision;

use self::play::{Player, updated_in_place};
use self::write::Writer;
use crate::compose::{Composed, Composer};
use crate::kernel_pass::{Brought, KernelPass, Op, Ops, Portion};
use crate::plan::{Fetched, History, Plan, Slot, SlotId, Storage, Upload};
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
                    // The next value of a state may come from outside, too.
                    l.states.iter().flat_map(|s| [s.init, s.next]).for_each(|id| *count.entry(id).or_default() += 1);
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
