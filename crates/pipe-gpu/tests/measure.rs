//! Times that the documentation quotes. Not run by default, since they judge the machine and not the program:
//! `cargo test --release -p pipe-gpu --test measure -- --ignored --nocapture`

#![allow(clippy::unwrap_used, clippy::single_range_in_vec_init, reason = "a test that panics has failed")]

mod common;

use std::collections::HashMap;
use std::time::Instant;

use common::{Draft, INCREMENT, counting, device};
use pipe_gpu::{Executor, RunOptions};
use pipe_plan::plan::{Binding, Step, Times};

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn ms(work: impl FnOnce()) -> f64 {
    let started = Instant::now();
    work();
    started.elapsed().as_secs_f64() * 1e3
}

#[test]
#[ignore = "measures the machine"]
fn measure() {
    let opened = median((0..7).map(|_| ms(|| drop(device(true)))).collect());
    println!("{}: open and close {opened:.1} ms", device(true).name());

    for share_memory in [true, false] {
        let way = if share_memory { "mapped where possible" } else { "staged" };
        let mut e = Executor::new(device(share_memory), None);
        for mib in [4_u64, 128] {
            let bytes = mib << 20;
            let mut d = Draft::new("transfer");
            let kernel = d.kernel(INCREMENT, &[Binding::ReadBuffer, Binding::WriteBuffer]);
            let (a, b) = (d.words(bytes / 4), d.words(bytes / 4));
            d.upload("in", a, &[0..bytes]);
            d.run(kernel, &[a, b], [1, 1, 1]);
            d.fetch("out", &[(b, 0..bytes)]);
            let prepared = e.prepare(d.done()).unwrap();
            let host = vec![1_u8; bytes as usize];
            let inputs = HashMap::from([("in", host.as_slice())]);
            let runs: Vec<_> = (0..9).map(|_| e.run(&prepared, &inputs, &RunOptions::default()).unwrap().timings).collect();
            let rate = |ms: f64| bytes as f64 / (ms * 1e6);
            let (up, down) = (|| runs[1..].iter().map(|t| t.upload_ms), || runs[1..].iter().map(|t| t.readback_ms));
            println!(
                "{way}, {mib} MiB: upload {:.2} GB/s (first {:.2}), readback {:.2} GB/s (first {:.2})",
                rate(median(up().collect())),
                rate(runs[0].upload_ms),
                rate(median(down().collect())),
                rate(runs[0].readback_ms)
            );
            e.release(prepared);
        }
    }

    let mut e = Executor::new(device(true), None);
    let mut d = Draft::new("launches");
    let kernel = d.kernel(INCREMENT, &[Binding::ReadBuffer, Binding::WriteBuffer]);
    let (seed, a, b) = (d.words(4), d.words(4), d.words(4));
    d.upload("seed", seed, &[0..16]);
    let n = 20_000;
    d.0.steps.push(Step::Repeat(counting(kernel, seed, [a, b], Times::Fixed(n))));
    let plan = d.done();
    let prepare = ms(|| {
        let prepared = e.prepare(plan.clone()).unwrap();
        e.release(prepared);
    });
    let again = ms(|| {
        let prepared = e.prepare(plan.clone()).unwrap();
        e.release(prepared);
    });
    let prepared = e.prepare(plan).unwrap();
    let inputs = HashMap::from([("seed", [0_u8; 16].as_slice())]);
    let runs = (0..7).map(|_| e.run(&prepared, &inputs, &RunOptions::default()).unwrap().timings.compute_ms);
    let each = median(runs.collect()) * 1e3 / f64::from(n);
    println!("prepare {prepare:.2} ms, again {again:.2} ms; a launch in a loop of {n}: {each:.1} µs");

    for size in [[1024, 1024], [4096, 4096]] {
        let rate = pipe_gpu::probe::copy_bandwidth(&mut e, size).unwrap();
        println!("copy of {}x{} RGBA float: {rate:.2} GB/s", size[0], size[1]);
    }
    for f in pipe_gpu::probe::examine(e.device()).unwrap() {
        println!("  {:<22} {} {}", f.name, if f.good { "ok" } else { "BAD" }, f.value);
    }
}
