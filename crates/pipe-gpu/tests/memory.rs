//! Bytes: uploads, fetches, reuse of memory, budgets, and values kept between frames.

#![allow(clippy::unwrap_used, clippy::single_range_in_vec_init, reason = "a test that panics has failed")]

mod common;

use std::collections::HashMap;
use std::sync::Arc;

use common::{Draft, INCREMENT, executor, executors, grey, once, run, uints};
use pipe_gpu::{Choice, Executor, GpuError, InMemory, RunOptions};
use pipe_plan::Plan;
use pipe_plan::plan::{Binding, History, Step, Storage};

/// Uploads `len` words and fetches them plus one.
fn increment(len: u64) -> Arc<Plan> {
    let mut d = Draft::new("increment");
    let kernel = d.kernel(INCREMENT, &[Binding::ReadBuffer, Binding::WriteBuffer]);
    let (a, b) = (d.words(len), d.words(len));
    d.upload("in", a, &[0..len * 4]);
    d.run(kernel, &[a, b], [len.div_ceil(64) as u32, 1, 1]);
    d.fetch("out", &[(b, 0..len * 4)]);
    d.done()
}

fn numbers(len: u64) -> Vec<u8> {
    (0..len as u32).flat_map(|i| i.wrapping_mul(2_654_435_761).to_le_bytes()).collect()
}

#[test]
fn uploads_larger_than_all_staging_buffers_arrive_whole() {
    // 2.5 chunks of 32 MiB.
    let len = 20 << 20;
    let data: Vec<u8> = (0..len as u32).flat_map(u32::to_le_bytes).collect();
    let mut d = Draft::new("big");
    let kernel = d.kernel(
        "@group(0) @binding(0) var<storage, read> a: array<u32>;
         @group(0) @binding(1) var<storage, read_write> b: array<u32>;
         @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) n: vec3u) {
             for (var i = id.x; i < arrayLength(&b); i += n.x * 64u) { b[i] = a[i] + 1u; }
         }",
        &[Binding::ReadBuffer, Binding::WriteBuffer],
    );
    let (a, b) = (d.words(len), d.words(len));
    d.upload("in", a, &[0..len * 4]);
    d.run(kernel, &[a, b], [4096, 1, 1]);
    d.fetch("out", &[(b, 0..len * 4)]);
    let plan = d.done();
    for mut e in executors() {
        for _ in 0..2 {
            let out = once(&mut e, plan.clone(), &[("in", &data)]);
            let back = &out.fetched["out"];
            assert_eq!(back.len(), data.len());
            let wrong = back.chunks_exact(4).zip(1_u32..).position(|(b, i)| b != i.to_le_bytes());
            assert_eq!(wrong, None);
        }
    }
}

#[test]
fn an_external_in_three_parts_comes_back_in_three_parts() {
    let mut d = Draft::new("parts");
    let kernel = d.kernel(INCREMENT, &[Binding::ReadBuffer, Binding::WriteBuffer]);
    let data = numbers(1000);
    // Each slot gathers two ranges of the external; together they cover it, in another order.
    let ranges = [[0..400, 2800..3000], [400..1600, 3000..3004], [1600..2800, 3004..4000]];
    let mut parts = Vec::new();
    let mut expected = Vec::new();
    for ranges in ranges {
        let len: u64 = ranges.iter().map(|r| r.end - r.start).sum::<u64>() / 4;
        let (a, b) = (d.words(len), d.words(len));
        d.upload("in", a, &ranges);
        d.run(kernel, &[a, b], [len.div_ceil(64) as u32, 1, 1]);
        let at = expected.len() as u64 * 4;
        let slice = |r: &std::ops::Range<u64>| uints(&data[r.start as usize..r.end as usize]);
        expected.extend(ranges.iter().flat_map(slice).map(|n| n.wrapping_add(1)));
        parts.push((b, at..at + len * 4));
    }
    d.fetch("out", &parts);
    let plan = d.done();
    for mut e in executors() {
        assert_eq!(uints(&once(&mut e, plan.clone(), &[("in", &data)]).fetched["out"]), expected);
    }
}

#[test]
fn bytes_that_fill_no_whole_word_are_padded_with_zeros() {
    let mut d = Draft::new("ragged");
    let kernel = d.kernel(
        "@group(0) @binding(0) var<storage, read> a: array<u32>;
         @group(0) @binding(1) var<storage, read_write> b: array<u32>;
         @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u) { b[id.x] = a[id.x]; }",
        &[Binding::ReadBuffer, Binding::WriteBuffer],
    );
    let (a, b) = (d.words(4), d.words(4));
    d.upload("in", a, &[1..8]);
    d.run(kernel, &[a, b], [2, 1, 1]);
    d.fetch("out", &[(b, 0..7)]);
    d.fetch("padded", &[(b, 0..8)]);
    let plan = d.done();
    for mut e in executors() {
        let out = once(&mut e, plan.clone(), &[("in", &[9, 1, 2, 3, 4, 5, 6, 7])]);
        assert_eq!(out.fetched["out"], [1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(out.fetched["padded"], [1, 2, 3, 4, 5, 6, 7, 0]);
    }
}

#[test]
fn fetched_bytes_can_be_taken_without_a_copy() {
    for mut e in executors() {
        let prepared = e.prepare(increment(1000)).unwrap();
        let data = numbers(1000);
        let mut sum = 0_u64;
        let mut end = 0;
        let inputs = HashMap::from([("in", data.as_slice())]);
        e.run_into(&prepared, &inputs, &mut InMemory::new(&inputs), &RunOptions::default(), &mut |part| {
            assert_eq!((part.name, part.range.start), ("out", end));
            end = part.range.end;
            sum += uints(part.bytes).into_iter().map(u64::from).sum::<u64>();
        })
        .unwrap();
        assert_eq!(end, 4000);
        assert_eq!(sum, uints(&data).into_iter().map(|n| u64::from(n.wrapping_add(1))).sum::<u64>());
    }
}

#[test]
fn too_few_bytes_are_refused_with_the_input_named() {
    let mut e = executor();
    let prepared = e.prepare(increment(100)).unwrap();
    let inputs = HashMap::from([("in", [0_u8; 10].as_slice())]);
    let error = e.run(&prepared, &inputs, &RunOptions::default()).map(|_| ()).unwrap_err();
    assert_eq!(error, GpuError::ShortInput { name: "in".into(), got: 10, wanted: 400 });
}

#[test]
fn a_plan_over_the_budget_is_refused_before_anything_is_made() {
    let mut e = executor();
    let mut d = Draft::new("huge");
    // Nobody has this much memory: allocating it first would be noticed.
    for _ in 0..64 {
        d.image(pipe_graph::types::ImageType::new([16384, 16384], 4));
    }
    e.set_budget(Some(1 << 30));
    let Err(error) = e.prepare(d.done()) else { panic!("it was prepared") };
    let GpuError::OverBudget { needed, budget, largest, .. } = &error else { panic!("{error}") };
    assert_eq!((*needed, *budget), (64 << 32, 1 << 30));
    assert!(largest.starts_with("slot 0 (image 16384x16384 of 4 channels, 4.0 GiB), slot 1"), "{largest}");
    let text = error.to_string();
    assert!(text.contains("256.0 GiB") && text.contains("--vram"), "{text}");
    // Within the budget, staging buffers shrink to what is left.
    let data = numbers(1 << 20);
    e.set_budget(Some(10 << 20));
    let out = once(&mut e, increment(1 << 20), &[("in", &data)]);
    assert_eq!(uints(&out.fetched["out"])[7], uints(&data)[7].wrapping_add(1));
}

#[test]
fn what_is_larger_than_the_device_allows_is_refused() {
    let mut e = executor();
    let most = e.device().limits().max_image;
    let mut d = Draft::new("wide");
    d.image(grey([most + 1, 1]));
    let Err(error) = e.prepare(d.done()) else { panic!("it was prepared") };
    assert!(matches!(&error, GpuError::TooLarge { what, .. } if what == "wide: slot 0"), "{error}");
    let mut d = Draft::new("long");
    d.slot(Storage::Buffer { bytes: e.device().limits().max_binding_bytes + 256 });
    assert!(matches!(e.prepare(d.done()), Err(GpuError::TooLarge { .. })));
}

#[test]
fn memory_is_used_again_by_later_plans() {
    let mut e = executor();
    let data = numbers(256);
    for round in 0..3 {
        let out = once(&mut e, increment(256), &[("in", &data)]);
        assert_eq!(uints(&out.fetched["out"])[5], uints(&data)[5].wrapping_add(1), "round {round}");
        once(&mut e, increment(64), &[("in", &data)]);
    }
}

/// Answers the input of `delay` frames ago, zero before that.
fn delayed(delay: u32) -> Arc<Plan> {
    let mut d = Draft::new("feedback");
    let kernel = d.kernel(INCREMENT, &[Binding::ReadBuffer, Binding::WriteBuffer]);
    let (input, keep, old, out) = (d.words(4), d.words(4), d.words(4), d.words(4));
    d.upload("in", input, &[0..16]);
    d.run(kernel, &[input, keep], [1, 1, 1]);
    d.run(kernel, &[old, out], [1, 1, 1]);
    d.fetch("out", &[(out, 0..4)]);
    d.0.histories.push(History { name: "h".into(), delay, keep, recall: Some(old) });
    d.done()
}

#[test]
fn values_wait_as_many_frames_as_they_should() {
    for delay in 1..=3 {
        let mut e = executor();
        let prepared = e.prepare(delayed(delay)).unwrap();
        let frame = |e: &mut Executor, n: u32| {
            let bytes = [n, 0, 0, 0].map(u32::to_le_bytes).concat();
            let out = e.run(&prepared, &HashMap::from([("in", bytes.as_slice())]), &RunOptions::default()).unwrap();
            // Both kernels add 1; what is not there yet is zero.
            uints(&out.fetched["out"])[0]
        };
        let seen: Vec<u32> = (0..6).map(|n| frame(&mut e, 10 * (n + 1))).collect();
        let expected: Vec<u32> = (0..6).map(|n: u32| n.checked_sub(delay).map_or(1, |old| 10 * (old + 1) + 2)).collect();
        assert_eq!(seen, expected, "delay {delay}");
        e.forget();
        assert_eq!(frame(&mut e, 1), 1, "forgotten");
    }
}

#[test]
fn pipelines_are_remembered_in_a_folder() {
    let folder = std::env::temp_dir().join(format!("pipe-gpu-test-{}", std::process::id()));
    for _ in 0..2 {
        let mut e = Executor::new(common::device(true), Some(&folder));
        once(&mut e, increment(64), &[("in", &numbers(64))]);
    }
    let files: Vec<_> = std::fs::read_dir(&folder).into_iter().flatten().flatten().collect();
    assert!(files.iter().all(|f| f.path().extension().is_none_or(|e| e != "part")), "{files:?}");
    // A damaged file is no error.
    for file in &files {
        std::fs::write(file.path(), b"not a cache").unwrap();
    }
    let mut e = Executor::new(common::device(true), Some(&folder));
    once(&mut e, increment(64), &[("in", &numbers(64))]);
    std::fs::remove_dir_all(&folder).ok();
    // Neither is a folder that cannot be made.
    let mut e = Executor::new(common::device(true), Some(std::path::Path::new("/dev/null/none")));
    once(&mut e, increment(64), &[("in", &numbers(64))]);
}

#[test]
fn a_plan_that_contradicts_itself_is_an_error() {
    let mut d = Draft::new("wrong");
    let kernel = d.kernel(INCREMENT, &[Binding::ReadBuffer, Binding::WriteBuffer]);
    let a = d.words(4);
    let good = d.0.clone();
    let wrong = [run("few", kernel, &[a], [1, 1, 1]), run("many", kernel, &[a, pipe_plan::plan::SlotId(9)], [1, 1, 1])];
    let mut e = executor();
    for step in wrong {
        let Step::Run(run) = &step else { unreachable!() };
        let name = run.name.clone();
        let mut plan = good.clone();
        plan.steps.push(step);
        let Err(error) = e.prepare(Arc::new(plan)) else { panic!("it was prepared") };
        assert!(matches!(&error, GpuError::Plan { node, .. } if *node == name), "{error}");
    }
    // One slot read and written by one launch: wgpu refuses it, and the error names the pass.
    let mut plan = good;
    plan.steps.push(run("alias", kernel, &[a, a], [1, 1, 1]));
    let prepared = e.prepare(Arc::new(plan)).unwrap();
    let error = e.run(&prepared, &HashMap::new(), &RunOptions::default()).map(|_| ()).unwrap_err();
    assert!(matches!(&error, GpuError::Refused { node, .. } if node == "alias"), "{error}");
}

#[test]
fn devices_are_listed_and_chosen() {
    let all = pipe_gpu::enumerate();
    assert!(!all.is_empty());
    assert_eq!(Choice::parse(" CPU "), Choice::Cpu);
    assert_eq!(Choice::parse("1"), Choice::Index(1));
    assert_eq!(Choice::parse(""), Choice::Best);
    assert_eq!(Choice::parse("llvm"), Choice::Name("llvm".into()));
    let by_name = pipe_gpu::Device::open(&Choice::Name(all[0].name.to_uppercase())).unwrap();
    assert_eq!(by_name.description().index, 0);
    let error = pipe_gpu::Device::open(&Choice::Index(99)).unwrap_err();
    assert!(matches!(&error, GpuError::NoSuchDevice { .. }), "{error}");
    assert!(error.to_string().contains("99") && error.to_string().contains(&all[0].name), "{error}");
    // A device is opened on one thread and used on another.
    let device = std::thread::spawn(|| common::device(true)).join().unwrap();
    once(&mut Executor::new(device, None), increment(8), &[("in", &numbers(8))]);
}

#[test]
fn probes_find_the_device_sound() {
    let device = common::device(true);
    let findings = pipe_gpu::probe::examine(&device).unwrap();
    assert!(findings.iter().all(|f| f.good || !f.vital), "{findings:#?}");
}
