//! Small measurements: what `doctor` tests and what `bench` compares with.
//!
//! Each is a plan of one kernel, run like any other: so what is measured is what graphs get, and what is tested is the
//! way that graphs go.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;

use pipe_graph::pass::Limits;
use pipe_graph::types::{ImageType, Precision};
use pipe_plan::Plan;
use pipe_plan::plan::{Binding, Fetched, Kernel, KernelId, Launch, Repeat, Run, Slot, SlotId, Source, Step, Storage, Times, Upload};

use crate::device::Device;
use crate::error::GpuError;
use crate::execute::{Executor, RunOptions};

/// One thing that was tested.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Finding {
    /// What.
    pub name: &'static str,
    /// What came out.
    pub value: String,
    /// Whether it is as it should be.
    pub good: bool,
    /// Whether pipe cannot work without it.
    pub vital: bool,
    /// What to do about it.
    pub hint: &'static str,
}

/// A plan of one kernel over some buffers and images.
fn single(label: &str, wgsl: &str, slots: Vec<Slot>, bindings: Vec<Binding>, groups: [u32; 3]) -> Plan {
    let ids: Vec<SlotId> = (0..slots.len()).map(|i| SlotId(i as u32)).collect();
    let bytes: u64 = slots.iter().map(|s| s.storage.bytes()).sum();
    let uploads = ids.iter().zip(&slots).filter(|(_, s)| s.uploaded);
    let uploads =
        uploads.map(|(id, s)| Upload { name: "in".into(), ranges: std::iter::once(0..s.storage.bytes()).collect(), slot: *id }).collect();
    let fetches = ids.iter().zip(&slots).filter(|(_, s)| s.fetched);
    let fetches = fetches.map(|(id, s)| Fetched { name: "out".into(), parts: vec![(*id, 0..s.storage.bytes())] }).collect();
    Plan {
        name: label.to_owned(),
        limits: Limits::default(),
        kernels: vec![Kernel {
            label: label.to_owned(),
            source: Source::Text(Arc::from(wgsl)),
            bindings,
            launch: Launch::Compute,
            trusted: true,
        }],
        uniforms: Vec::new(),
        literals: Vec::new(),
        uploads,
        steps: vec![Step::Run(Run {
            name: label.to_owned(),
            nodes: vec![label.to_owned()],
            kernel: KernelId(0),
            slots: ids,
            uniform_offset: 0,
            groups,
            clears: Vec::new(),
            bytes,
            reads: Vec::new(),
            writes: Vec::new(),
        })],
        fetches,
        histories: Vec::new(),
        peak_bytes: bytes,
        naive_bytes: bytes,
        bytes_moved: bytes,
        slots,
    }
}

const fn buffer(bytes: u64, uploaded: bool, fetched: bool) -> Slot {
    Slot { storage: Storage::Buffer { bytes }, uploaded, fetched }
}

/// Copies an RGBA float image into another, again and again; answers GB/s, read and written bytes counted, the median
/// of nine.
pub fn copy_bandwidth(executor: &mut Executor, size: [u32; 2]) -> Result<f64, GpuError> {
    let image = ImageType { size, channels: 4, precision: Precision::F32 };
    let wgsl = "@group(0) @binding(0) var a: texture_2d<f32>;\n\
        @group(0) @binding(1) var b: texture_storage_2d<rgba32float, write>;\n\
        @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {\n\
        let p = vec2i(id.xy); if all(p < vec2i(textureDimensions(b))) { textureStore(b, p, textureLoad(a, p, 0)); } }";
    let slot = || Slot { storage: Storage::Image(image), uploaded: false, fetched: false };
    let bindings = vec![Binding::SampledImage, Binding::StorageImage(image)];
    let plan = Arc::new(single("copy", wgsl, vec![slot(), slot()], bindings, [size[0].div_ceil(8), size[1].div_ceil(8), 1]));
    let prepared = executor.prepare(plan.clone())?;
    let options = RunOptions { profile: true, ..RunOptions::default() };
    let mut rates = Vec::new();
    for run in 0..10 {
        let started = Instant::now();
        let out = executor.run(&prepared, &HashMap::new(), &options)?;
        let ms = out.timings.passes.get("copy").copied().filter(|ms| *ms > 0.0).unwrap_or(started.elapsed().as_secs_f64() * 1e3);
        if run > 0 {
            rates.push(plan.bytes_moved as f64 / (ms * 1e6));
        }
    }
    executor.release(prepared);
    rates.sort_by(f64::total_cmp);
    Ok(rates[rates.len() / 2])
}

/// Runs a kernel over one table of 64 words and answers them.
fn words(executor: &mut Executor, body: &str) -> Result<Vec<u32>, GpuError> {
    let wgsl = format!("@group(0) @binding(0) var<storage, read_write> out: array<u32>;\n{body}");
    let plan = single("probe", &wgsl, vec![buffer(256, false, true)], vec![Binding::WriteBuffer], [1, 1, 1]);
    let prepared = executor.prepare(Arc::new(plan))?;
    let mut out = executor.run(&prepared, &HashMap::new(), &RunOptions::default())?;
    executor.release(prepared);
    let bytes = out.fetched.shift_remove("out").unwrap_or_default();
    Ok(bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect())
}

/// Tests what pipe relies on. The device is opened anew, so that a test that loses it harms nothing else.
pub fn examine(device: &Device) -> Result<Vec<Finding>, GpuError> {
    let again = device.reopen()?;
    let mut executor = Executor::new(again, None);
    let mut findings = Vec::new();
    let loops = words(
        &mut executor,
        "@compute @workgroup_size(1) fn main() { var n = 0u; for (var i = 0u; i < 60000u; i++) { n += i & 1u; } out[0] = n; \
         var m = 0u; for (var i = 0u; i < 200000u; i++) { m += i & 1u; } out[1] = m; }",
    )?;
    findings.push(Finding {
        name: "loops",
        value: format!("60,000 iterations {}", if loops[0] == 30_000 { "count right" } else { "do not count right" }),
        good: loops[0] == 30_000,
        vital: true,
        hint: "the driver ends loops too early: results would be wrong",
    });
    findings.push(Finding {
        name: "long loops",
        value: if loops[1] == 100_000 { "200,000 iterations count right".into() } else { "end silently before 200,000 iterations".into() },
        good: loops[1] == 100_000,
        vital: false,
        hint: "known of Mesa's software renderer; built-in nodes stay below its limit, your own shaders should too",
    });
    let nan = words(
        &mut executor,
        "fn is_nan(x: f32) -> bool { return (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u; }\n\
         @compute @workgroup_size(1) fn main() { let v = bitcast<f32>(0x7fc00000u + (out[2] & 0u)); out[0] = select(0u, 1u, is_nan(v)); out[1] = select(0u, 1u, is_nan(1.0)); }",
    )?;
    findings.push(Finding {
        name: "NaN",
        value: "told apart by their bits".into(),
        good: nan[0] == 1 && nan[1] == 0,
        vital: true,
        hint: "the driver changes NaN bits: statistics would count them wrong",
    });
    let atomics = words(
        &mut executor,
        "var<workgroup> n: atomic<u32>;\n\
         @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) { if i == 0u { atomicStore(&n, 0u); } workgroupBarrier(); atomicAdd(&n, i + 1u); workgroupBarrier(); if i == 0u { out[0] = atomicLoad(&n); } }",
    )?;
    findings.push(Finding {
        name: "atomics and barriers",
        value: format!("1 + … + 64 = {}", atomics[0]),
        good: atomics[0] == 2080,
        vital: true,
        hint: "histograms would be wrong",
    });
    let halves = half_images(&mut executor)?;
    findings.push(Finding {
        name: "half images",
        value: match (halves, device.limits().half_storage) {
            (false, _) => "do not keep what is stored".into(),
            (true, true) => "of every channel count".into(),
            (true, false) => "of 4 channels only".into(),
        },
        good: halves && device.limits().half_storage,
        vital: !halves,
        hint: if halves {
            "1- and 2-channel half images take the memory of float ones here"
        } else {
            "options: (format: F16) gives wrong results"
        },
    });
    findings.push(Finding {
        name: "timestamps",
        value: if device.has_timestamps() { "yes".into() } else { "no".into() },
        good: device.has_timestamps(),
        vital: false,
        hint: "`bench` cannot tell passes apart",
    });
    let rate = copy_bandwidth(&mut executor, [2048, 2048])?;
    findings.push(Finding { name: "copy bandwidth", value: format!("{rate:.1} GB/s"), good: rate > 0.0, vital: false, hint: "" });
    let launch = launch_cost(&mut executor)?;
    findings.push(Finding { name: "launch", value: format!("{launch:.1} µs"), good: true, vital: false, hint: "" });
    let (up, down) = transfer_rates(&mut executor)?;
    findings.push(Finding { name: "upload", value: format!("{up:.1} GB/s"), good: true, vital: false, hint: "" });
    findings.push(Finding { name: "readback", value: format!("{down:.1} GB/s"), good: true, vital: false, hint: "" });
    Ok(findings)
}

/// Whether half images of every channel count that can be written keep numbers that halves can hold.
fn half_images(executor: &mut Executor) -> Result<bool, GpuError> {
    let formats = [(1, "r16float"), (2, "rg16float"), (4, "rgba16float")];
    let all = executor.device().limits().half_storage;
    for (channels, format) in formats.into_iter().filter(|(channels, _)| all || *channels == 4) {
        let image = ImageType { size: [16, 1], channels, precision: Precision::F16 };
        let write = format!(
            "@group(0) @binding(0) var o: texture_storage_2d<{format}, write>;\n\
             @compute @workgroup_size(16) fn main(@builtin(global_invocation_id) id: vec3u) {{\n\
             textureStore(o, id.xy, vec4f(exp2(f32(id.x)) + 0.5, -f32(id.x), 65504.0, 1.0)); }}"
        );
        let read = "@group(0) @binding(0) var a: texture_2d<f32>;\n\
             @group(0) @binding(1) var<storage, read_write> b: array<vec4f>;\n\
             @compute @workgroup_size(16) fn main(@builtin(global_invocation_id) id: vec3u) { b[id.x] = textureLoad(a, id.xy, 0); }";
        let slot = Slot { storage: Storage::Image(image), uploaded: false, fetched: false };
        let mut plan = single("half images", &write, vec![slot], vec![Binding::StorageImage(image)], [1, 1, 1]);
        let mut second =
            single("half images", read, vec![buffer(256, false, true)], vec![Binding::SampledImage, Binding::WriteBuffer], [1, 1, 1]);
        plan.slots.append(&mut second.slots);
        plan.kernels.append(&mut second.kernels);
        if let Some(Step::Run(mut run)) = second.steps.pop() {
            (run.kernel, run.slots) = (KernelId(1), vec![SlotId(0), SlotId(1)]);
            plan.steps.push(Step::Run(run));
        }
        plan.fetches.push(Fetched { name: "out".into(), parts: vec![(SlotId(1), 0..256)] });
        let prepared = executor.prepare(Arc::new(plan))?;
        let out = executor.run(&prepared, &HashMap::new(), &RunOptions::default())?;
        executor.release(prepared);
        let values: Vec<f32> = out.fetched["out"].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let good = values.chunks_exact(4).enumerate().all(|(i, pixel)| {
            // Above 1024 a half has no place for 0.5, and may round either way.
            let exact = (i as f32).exp2() + 0.5;
            let expected = [exact, -(i as f32), 65504.0, 1.0];
            let tolerance = [exact / 1024.0, 0.0, 0.0, 0.0];
            (0..channels as usize).all(|c| (pixel[c] - expected[c]).abs() <= tolerance[c])
        });
        if !good {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Microseconds that an empty launch takes among a thousand, the median of five.
fn launch_cost(executor: &mut Executor) -> Result<f64, GpuError> {
    let wgsl = "@group(0) @binding(0) var<storage, read_write> o: array<u32>;\n@compute @workgroup_size(1) fn main() { o[0] += 1u; }";
    let mut plan = single("launch", wgsl, vec![buffer(256, false, false)], vec![Binding::WriteBuffer], [1, 1, 1]);
    let body = std::mem::take(&mut plan.steps);
    plan.steps.push(Step::Repeat(Repeat {
        name: "launch".to_owned(),
        node: "launch".to_owned(),
        first: body.clone(),
        odd: body.clone(),
        even: body,
        count: Times::Fixed(1000),
        settle: Vec::new(),
    }));
    let prepared = executor.prepare(Arc::new(plan))?;
    let mut times = Vec::new();
    for _ in 0..6 {
        times.push(executor.run(&prepared, &HashMap::new(), &RunOptions::default())?.timings.compute_ms);
    }
    executor.release(prepared);
    // The first run compiles, and learns what a launch costs.
    times.remove(0);
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

/// GB/s to the device and back, the second of two runs.
fn transfer_rates(executor: &mut Executor) -> Result<(f64, f64), GpuError> {
    let bytes = 64_u64 << 20;
    let wgsl = "@group(0) @binding(0) var<storage, read> a: array<u32>;\n\
        @group(0) @binding(1) var<storage, read_write> b: array<u32>;\n\
        @compute @workgroup_size(1) fn main() { b[0] = a[0]; }";
    let slots = vec![buffer(bytes, true, false), buffer(bytes, false, true)];
    let plan = single("transfer", wgsl, slots, vec![Binding::ReadBuffer, Binding::WriteBuffer], [1, 1, 1]);
    let prepared = executor.prepare(Arc::new(plan))?;
    let host = vec![1_u8; bytes as usize];
    let inputs = HashMap::from([("in", host.as_slice())]);
    let mut timings = (0.0, 0.0);
    for _ in 0..2 {
        let out = executor.run(&prepared, &inputs, &RunOptions::default())?;
        timings = (out.timings.upload_ms, out.timings.readback_ms);
    }
    executor.release(prepared);
    let rate = |ms: f64| bytes as f64 / (ms.max(1e-3) * 1e6);
    Ok((rate(timings.0), rate(timings.1)))
}
