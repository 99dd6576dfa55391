//! Small plans written by hand, and a device to run them on. There is no skipping: without a device tests fail.

#![allow(dead_code, clippy::unwrap_used, clippy::single_range_in_vec_init, reason = "each test uses a part of it")]

use std::collections::HashMap;
use std::sync::Arc;

use pipe_gpu::{Choice, Device, Executor, OpenOptions, Outputs, RunOptions};
use pipe_graph::pass::Limits;
use pipe_graph::types::{ImageType, Precision};
use pipe_plan::plan::{Binding, Fetched, Kernel, KernelId, Launch, Plan, Repeat, Run, Slot, SlotId, Source, Step, Storage, Times, Upload};

/// The device that `PIPE_DEVICE` names, or the best one.
pub(crate) fn device(share_memory: bool) -> Device {
    let choice = Choice::parse(&std::env::var("PIPE_DEVICE").unwrap_or_default());
    Device::open_with(&choice, OpenOptions { share_memory, ..OpenOptions::default() }).unwrap_or_else(|e| panic!("{e}"))
}

/// One executor that maps the kernels' buffers where it can, one that stages as on a GPU.
pub(crate) fn executors() -> [Executor; 2] {
    [Executor::new(device(true), None), Executor::new(device(false), None)]
}

pub(crate) fn executor() -> Executor {
    Executor::new(device(true), None)
}

/// A plan under construction.
pub(crate) struct Draft(pub(crate) Plan);

impl Draft {
    pub(crate) fn new(name: &str) -> Self {
        Self(Plan {
            name: name.to_owned(),
            limits: Limits::default(),
            slots: Vec::new(),
            kernels: Vec::new(),
            uniforms: Vec::new(),
            literals: Vec::new(),
            uploads: Vec::new(),
            steps: Vec::new(),
            fetches: Vec::new(),
            histories: Vec::new(),
            peak_bytes: 0,
            naive_bytes: 0,
            bytes_moved: 0,
        })
    }

    pub(crate) fn slot(&mut self, storage: Storage) -> SlotId {
        self.0.slots.push(Slot { storage, uploaded: false, fetched: false });
        SlotId(self.0.slots.len() as u32 - 1)
    }

    /// A table of words.
    pub(crate) fn words(&mut self, len: u64) -> SlotId {
        self.slot(Storage::Buffer { bytes: (len * 4).max(16) })
    }

    pub(crate) fn image(&mut self, image: ImageType) -> SlotId {
        self.slot(Storage::Image(image))
    }

    pub(crate) fn kernel(&mut self, wgsl: &str, bindings: &[Binding]) -> KernelId {
        self.kernel_as(wgsl, bindings, Launch::Compute, true)
    }

    pub(crate) fn kernel_as(&mut self, wgsl: &str, bindings: &[Binding], launch: Launch, trusted: bool) -> KernelId {
        let label = format!("kernel {}", self.0.kernels.len());
        self.0.kernels.push(Kernel { label, source: Source::Text(Arc::from(wgsl)), bindings: bindings.to_vec(), launch, trusted });
        KernelId(self.0.kernels.len() as u32 - 1)
    }

    /// Adds a uniform block, answers its offset.
    pub(crate) fn uniform(&mut self, bytes: &[u8]) -> u32 {
        let offset = self.0.uniforms.len().next_multiple_of(256);
        self.0.uniforms.resize(offset, 0);
        self.0.uniforms.extend(bytes);
        offset as u32
    }

    pub(crate) fn upload(&mut self, name: &str, slot: SlotId, ranges: &[std::ops::Range<u64>]) {
        self.0.slots[slot.0 as usize].uploaded = true;
        self.0.uploads.push(Upload { name: name.to_owned(), ranges: ranges.to_vec(), slot });
    }

    pub(crate) fn fetch(&mut self, name: &str, parts: &[(SlotId, std::ops::Range<u64>)]) {
        for (slot, _) in parts {
            self.0.slots[slot.0 as usize].fetched = true;
        }
        self.0.fetches.push(Fetched { name: name.to_owned(), parts: parts.to_vec() });
    }

    pub(crate) fn run(&mut self, kernel: KernelId, slots: &[SlotId], groups: [u32; 3]) {
        let step = run("pass", kernel, slots, groups);
        self.0.steps.push(step);
    }

    pub(crate) fn done(self) -> Arc<Plan> {
        Arc::new(self.0)
    }
}

pub(crate) fn run(name: &str, kernel: KernelId, slots: &[SlotId], groups: [u32; 3]) -> Step {
    Step::Run(Run {
        name: name.to_owned(),
        nodes: vec![name.to_owned()],
        kernel,
        slots: slots.to_vec(),
        uniform_offset: 0,
        groups,
        clears: Vec::new(),
        bytes: 0,
        reads: Vec::new(),
        writes: Vec::new(),
    })
}

/// Changes a launch.
pub(crate) fn with(step: Step, change: impl FnOnce(&mut Run)) -> Step {
    match step {
        Step::Run(mut run) => {
            change(&mut run);
            Step::Run(run)
        }
        Step::Repeat(_) | Step::Tiles(_) => panic!("not a launch"),
    }
}

/// Prepares and runs a plan once.
pub(crate) fn once(executor: &mut Executor, plan: Arc<Plan>, inputs: &[(&str, &[u8])]) -> Outputs {
    let prepared = executor.prepare(plan).unwrap_or_else(|e| panic!("{e}"));
    let inputs: HashMap<&str, &[u8]> = inputs.iter().copied().collect();
    let outputs = executor.run(&prepared, &inputs, &RunOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    executor.release(prepared);
    outputs
}

pub(crate) fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

pub(crate) fn uints(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect()
}

pub(crate) fn grey(size: [u32; 2]) -> ImageType {
    ImageType { size, channels: 1, precision: Precision::F32 }
}

/// Adds 1 to every word of table `a` into table `b`.
pub(crate) const INCREMENT: &str = "
@group(0) @binding(0) var<storage, read> a: array<u32>;
@group(0) @binding(1) var<storage, read_write> b: array<u32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x < arrayLength(&b) { b[id.x] = a[id.x] + 1u; }
}";

/// Copies a 1-channel image into a table, row by row.
pub(crate) const UNPACK: &str = "
@group(0) @binding(0) var a: texture_2d<f32>;
@group(0) @binding(1) var<storage, read_write> b: array<f32>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(a);
    if all(id.xy < size) { b[id.y * size.x + id.x] = textureLoad(a, vec2i(id.xy), 0).x; }
}";

/// A loop that counts up: `first` reads the seed, states ping-pong between `a` (first, even) and `b` (odd).
pub(crate) fn counting(kernel: KernelId, seed: SlotId, [a, b]: [SlotId; 2], count: Times) -> Repeat {
    Repeat {
        name: "count".into(),
        node: "count".into(),
        first: vec![run("first", kernel, &[seed, a], [1, 1, 1])],
        odd: vec![run("odd", kernel, &[a, b], [1, 1, 1])],
        even: vec![run("even", kernel, &[b, a], [1, 1, 1])],
        count,
        settle: Vec::new(),
    }
}

/// Counts to `n` by iterations.
pub(crate) fn count_to(e: &mut Executor, n: u32) -> u32 {
    let mut d = Draft::new("count");
    let kernel = d.kernel(INCREMENT, &[Binding::ReadBuffer, Binding::WriteBuffer]);
    let (seed, a, b) = (d.words(4), d.words(4), d.words(4));
    d.upload("seed", seed, &[0..16]);
    d.0.steps.push(Step::Repeat(counting(kernel, seed, [a, b], Times::Fixed(n))));
    // Of a known length: later steps read what the last iteration wrote.
    d.fetch("out", &[(if n % 2 == 1 { a } else { b }, 0..4)]);
    uints(&once(e, d.done(), &[("seed", &[0; 16])]).fetched["out"])[0]
}
