//! Incremental runs: which passes run after a change, and that the result is that of a full run.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use std::collections::HashMap;
use std::sync::Arc;

use common::{Draft, executor, uints};
use pipe_gpu::{Executor, Prepared, RunOptions};
use pipe_plan::Plan;
use pipe_plan::plan::{Binding, History, KernelId, Repeat, SlotId, Step, Times};

/// `out = 3 a + b + parameter`, word by word.
const MIX: &str = "
@group(0) @binding(0) var<uniform> p: vec4u;
@group(0) @binding(1) var<storage, read> a: array<u32>;
@group(0) @binding(2) var<storage, read> b: array<u32>;
@group(0) @binding(3) var<storage, read_write> out: array<u32>;
@compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3u) { out[id.x] = 3u * a[id.x] + b[id.x] + p.x; }";

/// Adds `parameter × a` to what is there.
const UPDATE: &str = "
@group(0) @binding(0) var<uniform> p: vec4u;
@group(0) @binding(1) var<storage, read> a: array<u32>;
@group(0) @binding(2) var<storage, read_write> out: array<u32>;
@compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3u) { out[id.x] += p.x * a[id.x]; }";

struct Kernels {
    mix: KernelId,
    update: KernelId,
}

fn kernels(d: &mut Draft) -> Kernels {
    let uniform = Binding::Uniform { bytes: 16 };
    Kernels {
        mix: d.kernel(MIX, &[uniform, Binding::ReadBuffer, Binding::ReadBuffer, Binding::WriteBuffer]),
        update: d.kernel(UPDATE, &[uniform, Binding::ReadBuffer, Binding::WriteBuffer]),
    }
}

fn step(d: &mut Draft, kernel: KernelId, slots: &[SlotId], parameter: u32) -> Step {
    let offset = d.uniform(&[parameter, 0, 0, 0].map(u32::to_le_bytes).concat());
    common::with(common::run("pass", kernel, slots, [1, 1, 1]), |run| run.uniform_offset = offset)
}

/// A chain of passes, each of the one before and the input; one parameter each.
fn chain(parameters: &[u32]) -> Arc<Plan> {
    let mut d = Draft::new("chain");
    let k = kernels(&mut d);
    let input = d.words(4);
    d.upload("in", input, &[0..16]);
    let mut last = input;
    for parameter in parameters {
        let next = d.words(4);
        let step = step(&mut d, k.mix, &[last, input, next], *parameter);
        d.0.steps.push(step);
        last = next;
    }
    d.fetch("out", &[(last, 0..16)]);
    d.done()
}

fn expected(parameters: &[u32], input: u32) -> u32 {
    parameters.iter().fold(input, |value, p| value.wrapping_mul(3).wrapping_add(input).wrapping_add(*p))
}

/// Runs and answers the first word, and how many passes ran and were kept.
fn keep(e: &mut Executor, prepared: &Prepared, input: u32) -> (u32, usize, usize) {
    let bytes = [input; 4].map(u32::to_le_bytes).concat();
    let options = RunOptions { keep: true, ..RunOptions::default() };
    let out = e.run(prepared, &HashMap::from([("in", bytes.as_slice())]), &options).unwrap();
    (uints(&out.fetched["out"])[0], out.timings.passes_run, out.timings.passes_kept)
}

#[test]
fn a_changed_parameter_runs_its_pass_and_those_behind_it() {
    let mut e = executor();
    let mut prepared = e.prepare(chain(&[1, 2, 3])).unwrap();
    let mut check = |parameters: [u32; 3], input, run| {
        assert!(e.update(&mut prepared, &chain(&parameters)).unwrap());
        assert_eq!(keep(&mut e, &prepared, input), (expected(&parameters, input), run, 3 - run), "{parameters:?} {input}");
    };
    check([1, 2, 3], 5, 3);
    check([1, 2, 3], 5, 0);
    check([1, 2, 9], 5, 1);
    check([1, 7, 9], 5, 2);
    check([4, 7, 9], 5, 3);
    check([4, 7, 9], 6, 3);
    check([4, 7, 9], 6, 0);
}

#[test]
fn a_plan_with_a_node_more_finds_what_was_there() {
    let mut e = executor();
    let first = e.prepare(chain(&[1, 2, 3])).unwrap();
    assert_eq!(keep(&mut e, &first, 5).1, 3);
    e.release(first);
    let more = e.prepare(chain(&[1, 2, 3, 4])).unwrap();
    assert_eq!(keep(&mut e, &more, 5), (expected(&[1, 2, 3, 4], 5), 1, 3));
    e.release(more);
    let inserted = e.prepare(chain(&[1, 8, 2, 3, 4])).unwrap();
    assert_eq!(keep(&mut e, &inserted, 5), (expected(&[1, 8, 2, 3, 4], 5), 4, 1));
    e.release(inserted);
    let fewer = e.prepare(chain(&[1, 8])).unwrap();
    // The result is there, but in memory that the host cannot map; so its pass runs again, from what is kept.
    assert_eq!(keep(&mut e, &fewer, 5), (expected(&[1, 8], 5), 1, 1));
}

#[test]
fn a_run_that_keeps_nothing_runs_everything() {
    let mut e = executor();
    let prepared = e.prepare(chain(&[1, 2])).unwrap();
    keep(&mut e, &prepared, 5);
    let out = e.run(&prepared, &HashMap::from([("in", [5, 0, 0, 0].repeat(4).as_slice())]), &RunOptions::default()).unwrap();
    assert_eq!((out.timings.passes_run, out.timings.passes_kept), (2, 0));
    assert_eq!(uints(&out.fetched["out"])[0], expected(&[1, 2], 5));
}

#[test]
fn what_depends_on_an_earlier_frame_always_runs() {
    let plan = |parameter| {
        let mut d = Draft::new("feedback");
        let k = kernels(&mut d);
        let (input, still, old, sum) = (d.words(4), d.words(4), d.words(4), d.words(4));
        d.upload("in", input, &[0..16]);
        let first = step(&mut d, k.mix, &[input, input, still], parameter);
        let second = step(&mut d, k.mix, &[old, still, sum], 0);
        d.0.steps.extend([first, second]);
        d.fetch("out", &[(sum, 0..16)]);
        d.0.histories.push(History { name: "h".into(), delay: 1, keep: sum, recall: Some(old) });
        d.done()
    };
    let mut e = executor();
    let mut prepared = e.prepare(plan(1)).unwrap();
    let mut value = 0;
    for (frame, parameter) in [1, 1, 1, 4, 4].into_iter().enumerate() {
        e.update(&mut prepared, &plan(parameter)).unwrap();
        value = 3 * value + 4 * 2 + parameter;
        let run = if matches!(frame, 0 | 3) { 2 } else { 1 };
        assert_eq!(keep(&mut e, &prepared, 2), (value, run, 2 - run), "frame {frame}");
    }
}

/// Numbers in a fixed order that looks like none.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % n
    }
}

/// Passes, updates in place and loops in few slots, which take turns in holding values.
fn random_plan(shape: u64, parameters: &[u32]) -> Arc<Plan> {
    let (mut d, mut dice) = (Draft::new("random"), Dice(shape));
    let k = kernels(&mut d);
    let slots: Vec<SlotId> = (0..4 + dice.below(5)).map(|_| d.words(4)).collect();
    d.upload("in", slots[0], &[0..16]);
    d.0.literals.push((slots[1], Arc::from([1_u32, 2, 3, 4].map(u32::to_le_bytes).concat())));
    d.0.slots[1].uploaded = true;
    let mut defined = vec![slots[0], slots[1]];
    for parameter in parameters {
        let (a, b) = (defined[dice.below(defined.len())], defined[dice.below(defined.len())]);
        let others = |taken: &[SlotId]| slots.iter().copied().filter(|s| !taken.contains(s)).collect::<Vec<_>>();
        let free = others(&[a, b]);
        let out = free[dice.below(free.len())];
        let made = match dice.below(4) {
            0 if defined.contains(&out) => step(&mut d, k.update, &[a, out], *parameter),
            1 if others(&[a, b, out]).len() > 1 => {
                let other = others(&[a, b, out])[0];
                let [first, odd, even] =
                    [[a, b, out], [out, b, other], [other, b, out]].map(|slots| vec![step(&mut d, k.mix, &slots, *parameter)]);
                // An odd number of iterations ends in `out`; the other slot holds what nobody reads before it is written.
                defined.retain(|s| *s != other);
                let count = Times::Fixed([1, 3, 5][dice.below(3)]);
                Step::Repeat(Repeat { name: "loop".into(), node: "loop".into(), first, odd, even, count, settle: Vec::new() })
            }
            _ => step(&mut d, k.mix, &[a, b, out], *parameter),
        };
        d.0.steps.push(made);
        if !defined.contains(&out) {
            defined.push(out);
        }
    }
    d.fetch("out", &[(defined[dice.below(defined.len())], 0..16)]);
    d.done()
}

#[test]
fn after_random_edits_of_random_plans_the_result_is_that_of_a_full_run() {
    let mut dice = Dice(3);
    let (mut e, mut fresh) = (executor(), executor());
    let mut kept = 0;
    for round in 0..25 {
        let shape = dice.below(1 << 30) as u64;
        let mut parameters: Vec<u32> = (0..3 + dice.below(6)).map(|_| dice.below(3) as u32).collect();
        let mut prepared = e.prepare(random_plan(shape, &parameters)).unwrap();
        let mut input = 1;
        for edit in 0..6 {
            let plan = random_plan(shape, &parameters);
            assert!(e.update(&mut prepared, &plan).unwrap());
            let (value, _, spared) = keep(&mut e, &prepared, input);
            kept += spared;
            let bytes = [input; 4].map(u32::to_le_bytes).concat();
            let full = common::once(&mut fresh, plan, &[("in", &bytes)]);
            assert_eq!(value, uints(&full.fetched["out"])[0], "plan {round}, edit {edit}");
            let at = dice.below(parameters.len() + 1);
            match parameters.get_mut(at) {
                Some(parameter) => *parameter = dice.below(3) as u32,
                None => input = dice.below(3) as u32,
            }
        }
        e.release(prepared);
    }
    assert!(kept > 100, "{kept}");
}
