//! What memory holds, by content; and which part of a run can be spared for it.
//!
//! A run is a list of [`Act`]s: literals, uploads, recalled histories, then the plan's steps. The content that an act
//! leaves in a slot has a [`Key`], the hash of what the act does and of the keys of all that it finds in its slots. The
//! executor is deterministic, so equal keys are equal bits, whichever run or plan made them. [`Course::needed`] chooses
//! acts and then goes through exactly those, key by key: it is done once every chosen act finds in its slots what it
//! would find in a full run, and what is fetched and kept at the end is there. So a run of the chosen acts equals a full
//! run, however slots are shared; sharing only leaves less to spare.
//!
//! A loop is one act: it is run as a whole or spared as a whole. What a history recalls has a key of its own in every
//! frame, so nothing that depends on it is ever spared.

use std::hash::Hash;
use std::sync::atomic::{AtomicU64, Ordering};

use pipe_plan::plan::{Binding, Crossing, Launch, Plan, Repeat, Run, SlotId, Step, Tiling, Times};
use rayon::prelude::*;
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

/// Stands for a content: equal keys, equal bits.
pub(crate) type Key = u128;

/// Bytes that one thread hashes at a time.
const PIECE: usize = 1 << 20;

/// Stands for nothing that anybody wrote.
const NOTHING: Key = 0;

/// The key of some bytes, on all cores.
pub(crate) fn of_bytes(bytes: &[u8]) -> Key {
    let pieces: Vec<Key> = bytes.par_chunks(PIECE).map(xxh3_128).collect();
    of((bytes.len(), pieces))
}

/// The key of a small thing.
pub(crate) fn of(value: impl Hash) -> Key {
    let mut hash = Xxh3::new();
    value.hash(&mut hash);
    hash.digest128()
}

/// A key that equals no other.
pub(crate) fn unique() -> Key {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    of(("unique", NEXT.fetch_add(1, Ordering::Relaxed)))
}

/// Something that changes slots.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Act {
    /// What it does, apart from what it finds.
    work: Key,
    /// The slots that it touches, each once.
    uses: Vec<Use>,
}

#[derive(Debug, Clone, PartialEq)]
struct Use {
    slot: usize,
    writes: bool,
    /// Zeroed before, so that what was there is of no interest.
    clears: bool,
}

impl Act {
    /// Fills a slot with something known.
    pub(crate) fn fill(slot: SlotId, work: Key) -> Self {
        Self { work, uses: vec![Use { slot: slot.0 as usize, writes: true, clears: true }] }
    }

    /// The same, leaving what no other run leaves.
    pub(crate) fn once(&self) -> Self {
        Self { work: unique(), uses: self.uses.clone() }
    }
}

/// The acts of a plan's steps.
pub(crate) fn steps(plan: &Plan) -> Vec<Act> {
    let kernels: Vec<Key> = plan.kernels.iter().map(of).collect();
    let act = |step: &Step| {
        let mut reader = Reader { plan, kernels: &kernels, hash: Xxh3::new(), uses: Vec::new() };
        reader.step(step);
        if let Step::Run(run) = step {
            // In a loop a slot is cleared again and again, and its first content may matter all the same.
            reader.uses.iter_mut().for_each(|u| u.clears = run.clears.contains(&SlotId(u.slot as u32)));
        }
        Act { work: reader.hash.digest128(), uses: reader.uses }
    };
    plan.steps.iter().map(act).collect()
}

/// Reads what a step does. Slots are numbered as they come, so that equal work has equal keys in every plan.
struct Reader<'a> {
    plan: &'a Plan,
    kernels: &'a [Key],
    hash: Xxh3,
    uses: Vec<Use>,
}

impl Reader<'_> {
    fn step(&mut self, step: &Step) {
        match step {
            Step::Run(run) => self.run(run),
            Step::Repeat(repeat) => self.repeat(repeat),
            Step::Tiles(tiling) => self.tiles(tiling),
        }
    }

    /// What tiles touch. What they leave is made of pixels that never are on the device together: see [`Act::once`].
    fn tiles(&mut self, tiling: &Tiling) {
        tiling.body.iter().for_each(|step| self.step(step));
        tiling.clears.iter().for_each(|slot| self.slot(*slot, true));
        // The same slots for every tile.
        let uploads = tiling.tiles.first().map_or(&[] as &[Crossing], |tile| &tile.uploads);
        uploads.iter().for_each(|upload| self.slot(upload.slot, true));
    }

    fn run(&mut self, run: &Run) {
        let at = run.kernel.0 as usize;
        // Preparing refuses plans that contradict themselves; here they only must do no harm.
        let Some(kernel) = self.plan.kernels.get(at) else { return };
        (self.kernels[at], run.groups).hash(&mut self.hash);
        let mut slots = run.slots.iter();
        for binding in &kernel.bindings {
            if let Binding::Uniform { bytes } = binding {
                let block = self.plan.uniforms.get(run.uniform_offset as usize..).unwrap_or_default();
                self.hash.update(&block[..block.len().min(*bytes as usize)]);
            } else if binding.takes_slot()
                && let Some(slot) = slots.next()
            {
                let writes = !matches!(binding, Binding::SampledImage | Binding::SampledVolume | Binding::ReadBuffer);
                self.slot(*slot, writes);
            }
        }
        if let (Launch::Points(_), Some(target)) = (kernel.launch, slots.next()) {
            self.slot(*target, true);
        }
        run.clears.len().hash(&mut self.hash);
        run.clears.iter().for_each(|slot| self.slot(*slot, true));
    }

    fn repeat(&mut self, repeat: &Repeat) {
        for steps in [&repeat.first, &repeat.odd, &repeat.even] {
            steps.len().hash(&mut self.hash);
            steps.iter().for_each(|step| self.step(step));
        }
        match &repeat.count {
            Times::Fixed(n) => ("fixed", n).hash(&mut self.hash),
            Times::Until { value, limit, every, max } => {
                ("until", limit.to_bits(), every, max).hash(&mut self.hash);
                value.iter().for_each(|slot| self.slot(*slot, false));
            }
        }
        for (from, to) in &repeat.settle {
            self.slot(*from, false);
            self.slot(*to, true);
        }
    }

    fn slot(&mut self, slot: SlotId, writes: bool) {
        let slot = slot.0 as usize;
        let Some(about) = self.plan.slots.get(slot) else { return };
        let at = self.uses.iter().position(|u| u.slot == slot).unwrap_or_else(|| {
            self.uses.push(Use { slot, writes: false, clears: false });
            self.uses.len() - 1
        });
        self.uses[at].writes |= writes;
        // Kernels ask how large what they read is.
        (at, writes, about.storage).hash(&mut self.hash);
    }
}

/// A content, with the act that made it.
#[derive(Debug, Clone, Copy)]
struct Made {
    key: Key,
    by: usize,
}

/// How a full run would go.
pub(crate) struct Course<'a> {
    acts: &'a [Act],
    /// By act and use: what is found there, and what is left.
    found: Vec<Vec<Option<Made>>>,
    left: Vec<Vec<Option<Key>>>,
    /// By slot, at the end.
    end: Vec<Option<Made>>,
}

impl<'a> Course<'a> {
    pub(crate) fn new(acts: &'a [Act], slots: usize) -> Self {
        let mut now: Vec<Option<Made>> = vec![None; slots];
        let (mut found, mut left) = (Vec::with_capacity(acts.len()), Vec::with_capacity(acts.len()));
        for (by, act) in acts.iter().enumerate() {
            let before: Vec<Option<Made>> = act.uses.iter().map(|u| now[u.slot].filter(|_| !u.clears)).collect();
            // Who reads what nobody wrote may find anything.
            let blind = act.uses.iter().zip(&before).any(|(u, made)| !u.writes && made.is_none());
            let keys: Vec<Key> = before.iter().map(|made| made.map_or(NOTHING, |m| m.key)).collect();
            let result = if blind { unique() } else { of((act.work, keys)) };
            let after: Vec<Option<Key>> = act.uses.iter().enumerate().map(|(i, u)| u.writes.then(|| of((result, i)))).collect();
            for (u, key) in act.uses.iter().zip(&after) {
                if let Some(key) = *key {
                    now[u.slot] = Some(Made { key, by });
                }
            }
            found.push(before);
            left.push(after);
        }
        Self { acts, found, left, end: now }
    }

    /// Every content that a slot holds at some time, by slot.
    pub(crate) fn contents(&self) -> Vec<Vec<Key>> {
        let mut all = vec![Vec::new(); self.end.len()];
        for (act, keys) in self.acts.iter().zip(&self.left) {
            act.uses.iter().zip(keys).for_each(|(u, key)| all[u.slot].extend(*key));
        }
        all
    }

    /// Adds to `chosen` the acts that must run so that they and the `wanted` slots find what they would find in a full
    /// run, when slots hold `contents` now. Those are then what slots hold after the run.
    pub(crate) fn needed(&self, chosen: &mut [bool], wanted: &[SlotId], contents: &mut [Option<Key>]) {
        loop {
            let mut held = contents.to_vec();
            let mut missing: Vec<usize> = Vec::new();
            for (i, act) in self.acts.iter().enumerate().filter(|(i, _)| chosen[*i]) {
                missing.extend(self.lacking(i, &held));
                for (u, key) in act.uses.iter().zip(&self.left[i]) {
                    held[u.slot] = key.or(held[u.slot]);
                }
            }
            let ends = wanted.iter().map(|slot| slot.0 as usize);
            missing.extend(ends.filter_map(|slot| self.end[slot].filter(|made| held[slot] != Some(made.key))).map(|made| made.by));
            if missing.is_empty() {
                contents.copy_from_slice(&held);
                return;
            }
            // Whoever made what is missing; and at once who made what those will miss.
            while let Some(i) = missing.pop() {
                if !std::mem::replace(&mut chosen[i], true) {
                    missing.extend(self.lacking(i, contents));
                }
            }
        }
    }

    /// The acts that made what this one needs, where slots hold something else.
    fn lacking<'s>(&'s self, act: usize, held: &'s [Option<Key>]) -> impl Iterator<Item = usize> + 's {
        let uses = self.acts[act].uses.iter().zip(&self.found[act]);
        uses.filter_map(|(u, made)| made.filter(|made| held[u.slot] != Some(made.key))).map(|made| made.by)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in a fixed order that looks like none.
    struct Dice(u64);

    impl Dice {
        fn below(&mut self, n: usize) -> usize {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((self.0 >> 33) as usize) % n
        }
    }

    /// A few inputs, then acts that read what is there and write, update or clear; slots are shared freely.
    fn random_acts(dice: &mut Dice, slots: usize) -> Vec<Act> {
        let mut acts: Vec<Act> = (0..2).map(|slot| Act::fill(SlotId(slot), u128::from(dice.0) + u128::from(slot))).collect();
        let mut defined = vec![0, 1];
        for step in 0..2 + dice.below(10) {
            let mut uses = Vec::new();
            for _ in 0..=dice.below(2) {
                uses.push(Use { slot: defined[dice.below(defined.len())], writes: false, clears: false });
            }
            for _ in 0..=dice.below(2) {
                uses.push(Use { slot: dice.below(slots), writes: true, clears: dice.below(4) == 0 });
            }
            uses.sort_by_key(|u| u.slot);
            uses.dedup_by(|b, a| a.slot == b.slot);
            // Nobody reads and clears at once.
            for u in &uses {
                if !defined.contains(&u.slot) {
                    defined.push(u.slot);
                }
            }
            acts.push(Act { work: step as u128, uses });
        }
        acts
    }

    /// Runs acts on a pretended memory: what is written depends on all that is found.
    fn play(acts: &[Act], chosen: &[bool], memory: &mut [u128], defined: &mut [bool]) {
        for (act, chosen) in acts.iter().zip(chosen) {
            // What nobody wrote in this run must not matter, as kernels do not read it.
            let found: Vec<u128> = act.uses.iter().map(|u| if u.clears || !defined[u.slot] { 0 } else { memory[u.slot] }).collect();
            for (i, u) in act.uses.iter().enumerate().filter(|(_, u)| u.writes) {
                defined[u.slot] = true;
                if *chosen {
                    memory[u.slot] = of(("bits", act.work, &found, i));
                }
            }
        }
    }

    #[test]
    fn after_any_edit_what_is_run_gives_what_a_full_run_gives() {
        let mut dice = Dice(7);
        let (mut spared, mut all) = (0, 0);
        for _ in 0..2000 {
            let slots = 3 + dice.below(8);
            let mut acts = random_acts(&mut dice, slots);
            let wanted: Vec<SlotId> = (0..=dice.below(2)).map(|_| SlotId(dice.below(slots) as u32)).collect();
            let mut contents = vec![None; slots];
            let mut memory: Vec<u128> = (0..slots as u128).collect();
            for _ in 0..6 {
                let course = Course::new(&acts, slots);
                let mut chosen = vec![false; acts.len()];
                course.needed(&mut chosen, &wanted, &mut contents);
                play(&acts, &chosen, &mut memory, &mut vec![false; slots]);
                let (mut fresh, mut defined) = (vec![99; slots], vec![false; slots]);
                play(&acts, &vec![true; acts.len()], &mut fresh, &mut defined);
                for slot in wanted.iter().map(|s| s.0 as usize).filter(|s| defined[*s]) {
                    assert_eq!(memory[slot], fresh[slot], "{acts:?}");
                }
                spared += chosen.iter().filter(|c| !**c).count();
                all += acts.len();
                // Parameters change, also back to what they were; now and then an act comes or goes.
                let at = dice.below(acts.len());
                match dice.below(8) {
                    0 if acts.len() > 4 => drop(acts.pop()),
                    1 => acts.push(Act { work: 77, uses: acts[at].uses.clone() }),
                    2 => {}
                    _ => acts[at].work = dice.below(3) as u128,
                }
            }
        }
        assert!(spared * 10 > all * 3, "{spared} of {all}");
    }

    fn chain(works: &[u128]) -> Vec<Act> {
        let mut acts = vec![Act::fill(SlotId(0), works[0])];
        for (i, work) in works.iter().enumerate().skip(1) {
            let read = Use { slot: i - 1, writes: false, clears: false };
            acts.push(Act { work: *work, uses: vec![read, Use { slot: i, writes: true, clears: false }] });
        }
        acts
    }

    fn run(works: &[u128], contents: &mut [Option<Key>]) -> Vec<bool> {
        let acts = chain(works);
        let mut chosen = vec![false; acts.len()];
        Course::new(&acts, acts.len()).needed(&mut chosen, &[SlotId(works.len() as u32 - 1)], contents);
        chosen
    }

    #[test]
    fn what_changed_runs_with_all_that_follows_from_it() {
        let mut contents = vec![None; 4];
        assert_eq!(run(&[1, 2, 3, 4], &mut contents), [true; 4]);
        assert_eq!(run(&[1, 2, 3, 4], &mut contents), [false; 4]);
        assert_eq!(run(&[1, 2, 3, 5], &mut contents), [false, false, false, true]);
        assert_eq!(run(&[1, 6, 3, 5], &mut contents), [false, true, true, true]);
        assert_eq!(run(&[7, 6, 3, 5], &mut contents), [true; 4]);
    }

    #[test]
    fn who_reads_what_nobody_wrote_always_runs() {
        let blind =
            Act { work: 1, uses: vec![Use { slot: 0, writes: false, clears: false }, Use { slot: 1, writes: true, clears: false }] };
        let mut contents = vec![None; 2];
        for _ in 0..2 {
            let mut chosen = [false];
            Course::new(std::slice::from_ref(&blind), 2).needed(&mut chosen, &[SlotId(1)], &mut contents);
            assert_eq!(chosen, [true]);
        }
    }

    #[test]
    fn bytes_are_told_apart_wherever_they_differ() {
        let mut bytes = vec![0_u8; 3 * PIECE + 5];
        let zeros = of_bytes(&bytes);
        assert_eq!(zeros, of_bytes(&bytes.clone()));
        for at in [0, PIECE, 3 * PIECE + 4] {
            bytes[at] = 1;
            assert_ne!(of_bytes(&bytes), zeros, "{at}");
            bytes[at] = 0;
        }
        assert_ne!(of_bytes(&bytes[1..]), zeros);
    }
}
