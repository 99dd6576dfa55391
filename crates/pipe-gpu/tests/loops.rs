//! Loops: parity, loops within loops, loops that end by a value, very long ones, and ends by force.

#![allow(clippy::unwrap_used, clippy::single_range_in_vec_init, reason = "a test that panics has failed")]

mod common;

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

use common::{Draft, INCREMENT, count_to, counting, executor, executors, floats, once, run, uints};
use pipe_gpu::{GpuError, RunOptions};
use pipe_plan::plan::{Binding, Repeat, SlotId, Step, Times};

#[test]
fn loops_run_as_often_as_they_say() {
    let mut e = executor();
    for n in [1, 2, 3, 4, 7, 100, 1001] {
        assert_eq!(count_to(&mut e, n), n);
    }
}

#[test]
fn a_loop_in_a_loop_starts_anew_each_time() {
    let mut d = Draft::new("nested");
    let kernel = d.kernel(INCREMENT, &[Binding::ReadBuffer, Binding::WriteBuffer]);
    let (seed, a, b, x, y) = (d.words(4), d.words(4), d.words(4), d.words(4), d.words(4));
    d.upload("seed", seed, &[0..16]);
    // Each outer iteration adds 3 by an inner loop and 1 by itself.
    let body = |from: SlotId, to: SlotId| {
        vec![Step::Repeat(counting(kernel, from, [x, y], Times::Fixed(3))), run("after", kernel, &[x, to], [1, 1, 1])]
    };
    d.0.steps.push(Step::Repeat(Repeat {
        name: "outer".into(),
        node: "outer".into(),
        first: body(seed, a),
        odd: body(a, b),
        even: body(b, a),
        count: Times::Fixed(6),
        settle: Vec::new(),
    }));
    d.fetch("out", &[(b, 0..4)]);
    assert_eq!(uints(&once(&mut executor(), d.done(), &[("seed", &[0; 16])]).fetched["out"]), [24]);
}

/// Halves a residual until it is below a limit; answers (iterations, residual).
fn halve(e: &mut pipe_gpu::Executor, start: f32, limit: f32, every: u32, max: u32) -> (u32, f32) {
    let mut d = Draft::new("until");
    let kernel = d.kernel(
        "struct S { residual: f32, count: u32 }
         @group(0) @binding(0) var<storage, read> a: S;
         @group(0) @binding(1) var<storage, read_write> b: S;
         @compute @workgroup_size(1) fn main() { b.residual = a.residual * 0.5; b.count = a.count + 1u; }",
        &[Binding::ReadBuffer, Binding::WriteBuffer],
    );
    let (seed, a, b) = (d.words(4), d.words(4), d.words(4));
    d.upload("seed", seed, &[0..16]);
    let mut repeat = counting(kernel, seed, [a, b], Times::Until { value: [a, b], limit, every, max });
    repeat.settle = vec![(a, b)];
    d.0.steps.push(Step::Repeat(repeat));
    // Of an unknown length: later steps read what odd iterations write.
    d.fetch("out", &[(b, 0..8)]);
    let mut bytes = [0; 16];
    bytes[..4].copy_from_slice(&start.to_le_bytes());
    let out = once(e, d.done(), &[("seed", &bytes)]);
    (uints(&out.fetched["out"])[1], floats(&out.fetched["out"])[0])
}

#[test]
fn a_loop_ends_at_the_first_check_below_the_limit() {
    for mut e in executors() {
        assert_eq!(halve(&mut e, 1.0, 0.3, 1, 100), (2, 0.25), "last iteration odd");
        assert_eq!(halve(&mut e, 1.0, 0.2, 1, 100), (3, 0.125), "last iteration even: settled by a copy");
        assert_eq!(halve(&mut e, 1.0, 0.3, 3, 100), (3, 0.125), "checked every third iteration");
        assert_eq!(halve(&mut e, 1.0, 0.6, 1, 100), (1, 0.5), "after the first");
        assert_eq!(halve(&mut e, 1.0, 0.0, 4, 9).0, 9, "never: the most iterations");
        assert_eq!(halve(&mut e, 1.0, 0.25, 1, 100), (3, 0.125), "equal is not below");
        assert_eq!(halve(&mut e, f32::NAN, 1e30, 1, 5).0, 5, "NaN is not below anything");
    }
}

/// A plan that keeps the device busy: `n` launches of a kernel that takes a part of a second on two cores.
fn slow(n: u32) -> std::sync::Arc<pipe_plan::Plan> {
    let mut d = Draft::new("slow");
    let kernel = d.kernel(
        "@group(0) @binding(0) var<storage, read_write> o: array<u32>;
         @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
             var x = id.x;
             for (var i = 0u; i < 60000u; i++) { x = x * 1664525u + 1013904223u; }
             o[id.x % 64u] = x;
         }",
        &[Binding::WriteBuffer],
    );
    let table = d.words(64);
    for _ in 0..n {
        d.0.steps.push(run("walk", kernel, &[table], [16, 1, 1]));
    }
    d.done()
}

#[test]
fn a_run_that_takes_too_long_ends_with_the_pass_and_does_not_hang() {
    let started = Instant::now();
    let mut e = executor();
    let prepared = e.prepare(slow(100_000)).unwrap();
    let limit = Duration::from_millis(300);
    let asked = Instant::now();
    let Err(error) = e.run(&prepared, &HashMap::new(), &RunOptions { timeout: Some(limit), ..RunOptions::default() }) else {
        panic!("it ended")
    };
    assert_eq!(error, GpuError::Timeout { node: "walk".into(), limit });
    assert!(asked.elapsed() < Duration::from_secs(3), "{:?}", asked.elapsed());
    assert!(error.to_string().contains("300ms"), "{error}");
    drop(prepared);
    drop(e);
    assert!(started.elapsed() < Duration::from_secs(30), "{:?}", started.elapsed());
}

#[test]
fn a_run_can_be_cancelled_from_outside() {
    let mut e = executor();
    let prepared = e.prepare(slow(100_000)).unwrap();
    let cancel = AtomicBool::new(false);
    let (result, waited) = std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(200));
            cancel.store(true, Ordering::Relaxed);
        });
        let started = Instant::now();
        let options = RunOptions { cancel: Some(&cancel), ..RunOptions::default() };
        (e.run(&prepared, &HashMap::new(), &options).map(|_| ()), started.elapsed())
    });
    assert_eq!(result, Err(GpuError::Interrupted));
    assert!(waited < Duration::from_secs(3), "{waited:?}");
}

#[test]
fn progress_of_the_outermost_loop_is_told_to_its_end() {
    let mut d = Draft::new("progress");
    let kernel = d.kernel(INCREMENT, &[Binding::ReadBuffer, Binding::WriteBuffer]);
    let (seed, a, b) = (d.words(4), d.words(4), d.words(4));
    d.upload("seed", seed, &[0..16]);
    d.0.steps.push(Step::Repeat(counting(kernel, seed, [a, b], Times::Fixed(500))));
    let mut e = executor();
    let prepared = e.prepare(d.done()).unwrap();
    let last = AtomicU32::new(0);
    let tell = |done: u32, of: u32| {
        assert_eq!(of, 500);
        assert!(last.swap(done, Ordering::Relaxed) < done);
    };
    let options = RunOptions { progress: Some(&tell), ..RunOptions::default() };
    e.run(&prepared, &HashMap::from([("seed", [0_u8; 16].as_slice())]), &options).unwrap();
    assert_eq!(last.load(Ordering::Relaxed), 500);
}
