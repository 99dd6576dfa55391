//! Plan → outputs.
//!
//! Everything that a plan needs is made once ([`Executor::prepare`]): pipelines, memory, bind groups. A run then only
//! records launches. Long loops are cut into submissions of some tens of milliseconds, measured as they go, with two
//! in flight: so no watchdog fires, the host never falls behind, and memory does not grow with the number of
//! iterations.

use std::collections::{HashMap, VecDeque};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indexmap::IndexMap;
use pipe_plan::plan::{Binding, Plan, Repeat, Run, SlotId, Step, Times};

use crate::device::Device;
use crate::error::GpuError;
use crate::pipelines::{Pipeline, Pipelines};
use crate::record::Recorder;
use crate::storage::{Memory, Pool, allocate};
use crate::transfer::{Transfer, copy_out, wait};

/// How to run.
#[derive(Clone, Copy, Default)]
pub struct RunOptions<'a> {
    /// Bounds the GPU work of one run.
    pub timeout: Option<Duration>,
    /// Measure the GPU time of every pass. Passes then run one by one.
    pub profile: bool,
    /// Set from outside to end the run early.
    pub cancel: Option<&'a AtomicBool>,
    /// Told now and then: iterations done and to do of the loop that is running.
    pub progress: Option<&'a (dyn Fn(u32, u32) + Sync)>,
}

/// Wall time of the parts of a run, and GPU time where it was measured.
#[derive(Debug, Clone, Default)]
pub struct Timings {
    /// Milliseconds of host bytes on their way in.
    pub upload_ms: f64,
    /// Milliseconds from the first launch to the end of the last.
    pub compute_ms: f64,
    /// Milliseconds of bytes on their way out.
    pub readback_ms: f64,
    /// GPU milliseconds by pass name, in the order of first launch; empty unless profiled.
    pub passes: IndexMap<String, f64>,
}

/// What came back.
#[derive(Debug, Default)]
pub struct Outputs {
    /// Bytes by the name of the fetch.
    pub fetched: IndexMap<String, Vec<u8>>,
    /// Where the time went.
    pub timings: Timings,
}

/// Runs plans on one device.
pub struct Executor {
    device: Device,
    pipelines: Pipelines,
    pool: Pool,
    transfer: Transfer,
    /// Earlier values of histories, the newest last.
    histories: HashMap<String, VecDeque<Memory>>,
}

/// A plan with everything that it needs on the device.
pub struct Prepared {
    plan: Arc<Plan>,
    memory: Vec<Memory>,
    uniforms: Option<wgpu::Buffer>,
    steps: Vec<Ready>,
    pipelines: Vec<Arc<Pipeline>>,
}

/// A step that can be recorded.
pub(crate) enum Ready {
    Run(ReadyRun),
    Repeat(ReadyRepeat),
}

pub(crate) struct ReadyRun {
    pub(crate) name: String,
    pub(crate) pipeline: Arc<Pipeline>,
    pub(crate) group: wgpu::BindGroup,
    pub(crate) groups: [u32; 3],
    pub(crate) clears: Vec<wgpu::Buffer>,
    pub(crate) target: Option<wgpu::TextureView>,
}

pub(crate) struct ReadyRepeat {
    first: Vec<Ready>,
    odd: Vec<Ready>,
    even: Vec<Ready>,
    repeat: Repeat,
}

impl Executor {
    /// An executor; `cache` is a folder for compiled pipelines.
    pub fn new(device: Device, cache: Option<&Path>) -> Self {
        let pipelines = cache.map(|folder| Pipelines::with_cache(&device, folder)).unwrap_or_default();
        Self { device, pipelines, pool: Pool::default(), transfer: Transfer::default(), histories: HashMap::new() }
    }

    /// The device.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Makes everything that a plan needs.
    pub fn prepare(&mut self, plan: Arc<Plan>) -> Result<Prepared, GpuError> {
        let mut nodes = vec![plan.name.clone(); plan.kernels.len()];
        name_kernels(&plan.steps, &mut nodes);
        let pipelines = self.pipelines.compile(&self.device, &plan.kernels, &nodes)?;
        let memory = self.pool.take(&self.device, &plan)?;
        let uniforms = (!plan.uniforms.is_empty()).then(|| {
            let buffer = self.device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("uniforms"),
                size: (plan.uniforms.len() as u64).next_multiple_of(256),
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            self.device.queue.write_buffer(&buffer, 0, &pad(&plan.uniforms));
            buffer
        });
        let maker = Maker { device: &self.device, plan: &plan, memory: &memory, uniforms: uniforms.as_ref(), pipelines: &pipelines };
        let steps = plan.steps.iter().map(|s| maker.ready(s)).collect();
        self.device.check(&plan.name)?;
        let mut prepared = Prepared { plan, memory, uniforms, steps, pipelines };
        self.write_literals(&mut prepared)?;
        Ok(prepared)
    }

    fn write_literals(&mut self, prepared: &mut Prepared) -> Result<(), GpuError> {
        for (slot, bytes) in &prepared.plan.literals {
            let all = [0..bytes.len() as u64];
            self.transfer.upload(&self.device, buffer(&prepared.memory, *slot), bytes, &all, None)?;
        }
        Ok(())
    }

    /// Takes over a plan that differs from the prepared one in parameters only; `false` when it differs in more.
    pub fn update(&mut self, prepared: &mut Prepared, plan: &Arc<Plan>) -> Result<bool, GpuError> {
        let old = &prepared.plan;
        let same = old.slots == plan.slots
            && old.kernels == plan.kernels
            && old.steps == plan.steps
            && old.fetches == plan.fetches
            && old.histories == plan.histories
            && old.uploads == plan.uploads
            && old.uniforms.len() == plan.uniforms.len()
            && old.literals.iter().map(|l| l.0).eq(plan.literals.iter().map(|l| l.0));
        if !same {
            return Ok(false);
        }
        let literals = old.literals != plan.literals;
        if old.uniforms != plan.uniforms
            && let Some(buffer) = &prepared.uniforms
        {
            self.device.queue.write_buffer(buffer, 0, &pad(&plan.uniforms));
        }
        prepared.plan = plan.clone();
        if literals {
            self.write_literals(prepared)?;
        }
        Ok(true)
    }

    /// Gives the memory of a prepared plan back, so that the next plan can use it.
    pub fn release(&mut self, prepared: Prepared) {
        let Prepared { plan, memory, .. } = prepared;
        self.pool.give(&plan, memory);
    }

    /// Uploads, runs, and brings back.
    pub fn run(
        &mut self,
        prepared: &Prepared,
        inputs: &HashMap<&str, &[u8]>,
        options: &RunOptions<'_>,
    ) -> Result<Outputs, GpuError> {
        let deadline = options.timeout.map(|t| Instant::now() + t);
        self.run_until(prepared, inputs, options, deadline).map_err(|e| match (e, options.timeout) {
            (GpuError::Timeout { node, .. }, Some(t)) => GpuError::Timeout { node, seconds: t.as_secs() },
            (e, _) => e,
        })
    }

    fn run_until(
        &mut self,
        prepared: &Prepared,
        inputs: &HashMap<&str, &[u8]>,
        options: &RunOptions<'_>,
        deadline: Option<Instant>,
    ) -> Result<Outputs, GpuError> {
        let plan = &prepared.plan;
        let mut outputs = Outputs::default();
        let started = Instant::now();
        for upload in &plan.uploads {
            let source = inputs.get(upload.name.as_str()).copied().unwrap_or_default();
            let wanted = upload.ranges.iter().map(|r| r.end).max().unwrap_or(0);
            if (source.len() as u64) < wanted {
                return Err(GpuError::ShortInput { name: upload.name.clone(), got: source.len() as u64, wanted });
            }
            self.transfer.upload(&self.device, buffer(&prepared.memory, upload.slot), source, &upload.ranges, deadline)?;
        }
        outputs.timings.upload_ms = millis(started);

        let started = Instant::now();
        self.recall(prepared);
        let mut recorder = Recorder::new(&self.device, *options, deadline);
        for step in &prepared.steps {
            step.record(&mut recorder, &mut self.transfer, &prepared.memory)?;
        }
        recorder.finish()?;
        outputs.timings.passes = recorder.into_times();
        outputs.timings.compute_ms = millis(started);
        self.keep(prepared)?;

        let started = Instant::now();
        let mut parts = Vec::new();
        for fetch in &plan.fetches {
            let bytes = fetch.parts.iter().map(|(_, range)| range.end).max().unwrap_or(0);
            outputs.fetched.insert(fetch.name.clone(), vec![0; bytes as usize]);
            parts.extend(fetch.parts.iter().map(|(slot, range)| (fetch.name.as_str(), *slot, range.clone())));
        }
        let buffers: Vec<_> = parts.iter().map(|(_, slot, range)| (buffer(&prepared.memory, *slot), range.end - range.start)).collect();
        let fetched = &mut outputs.fetched;
        self.transfer.download(&self.device, &buffers, deadline, |i, from| {
            let (name, _, range) = &parts[i];
            if let Some(whole) = fetched.get_mut(*name) {
                copy_out(&mut whole[range.start as usize..range.end as usize], from);
            }
        })?;
        outputs.timings.readback_ms = millis(started);
        Ok(outputs)
    }

    /// Fills the slots of histories with the values of `delay` frames ago.
    fn recall(&self, prepared: &Prepared) {
        let mut encoder = self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for history in &prepared.plan.histories {
            let (Some(slot), Some(ring)) = (history.recall, self.histories.get(&history.name)) else { continue };
            if let Some(old) = ring.len().checked_sub(history.delay as usize).and_then(|i| ring.get(i)) {
                copy(&mut encoder, old, &prepared.memory[slot.0 as usize]);
            }
        }
        self.device.queue.submit([encoder.finish()]);
    }

    /// Keeps the new values of histories.
    fn keep(&mut self, prepared: &Prepared) -> Result<(), GpuError> {
        for history in &prepared.plan.histories {
            let ring = self.histories.entry(history.name.clone()).or_default();
            let slot = &prepared.plan.slots[history.keep.0 as usize];
            let memory = if ring.len() >= history.delay as usize {
                ring.pop_front().expect("a delay is at least 1")
            } else {
                allocate(&self.device, slot, false, &history.name)?
            };
            let mut encoder = self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            copy(&mut encoder, &prepared.memory[history.keep.0 as usize], &memory);
            self.device.queue.submit([encoder.finish()]);
            self.histories.entry(history.name.clone()).or_default().push_back(memory);
        }
        Ok(())
    }

    /// Forgets all histories: the next frame is a first one.
    pub fn forget(&mut self) {
        self.histories.clear();
    }
}

fn millis(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

fn pad(bytes: &[u8]) -> Vec<u8> {
    let mut padded = bytes.to_vec();
    padded.resize(bytes.len().next_multiple_of(256), 0);
    padded
}

/// Gives each kernel the name of the first pass that launches it.
fn name_kernels(steps: &[Step], nodes: &mut [String]) {
    for step in steps.iter().rev() {
        match step {
            Step::Run(run) => nodes[run.kernel.0 as usize].clone_from(&run.name),
            Step::Repeat(r) => [&r.even, &r.odd, &r.first].into_iter().for_each(|s| name_kernels(s, nodes)),
        }
    }
}

fn buffer(memory: &[Memory], slot: SlotId) -> &wgpu::Buffer {
    match &memory[slot.0 as usize] {
        Memory::Buffer(buffer) => buffer,
        Memory::Texture { .. } => unreachable!("plans upload to and fetch from buffers only"),
    }
}

fn copy(encoder: &mut wgpu::CommandEncoder, from: &Memory, to: &Memory) {
    match (from, to) {
        (Memory::Texture { texture: from, .. }, Memory::Texture { texture: to, .. }) => {
            encoder.copy_texture_to_texture(from.as_image_copy(), to.as_image_copy(), from.size());
        }
        (Memory::Buffer(from), Memory::Buffer(to)) => encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size().min(to.size())),
        _ => unreachable!("copies are between slots of equal storage"),
    }
}

/// Makes steps ready.
struct Maker<'a> {
    device: &'a Device,
    plan: &'a Plan,
    memory: &'a [Memory],
    uniforms: Option<&'a wgpu::Buffer>,
    pipelines: &'a [Arc<Pipeline>],
}

impl Maker<'_> {
    fn ready(&self, step: &Step) -> Ready {
        let all = |steps: &[Step]| steps.iter().map(|s| self.ready(s)).collect();
        match step {
            Step::Run(run) => Ready::Run(self.run(run)),
            Step::Repeat(r) => {
                let repeat = Repeat { first: Vec::new(), odd: Vec::new(), even: Vec::new(), ..r.clone() };
                Ready::Repeat(ReadyRepeat { first: all(&r.first), odd: all(&r.odd), even: all(&r.even), repeat })
            }
        }
    }

    fn run(&self, run: &Run) -> ReadyRun {
        let kernel = &self.plan.kernels[run.kernel.0 as usize];
        let pipeline = self.pipelines[run.kernel.0 as usize].clone();
        let mut slots = run.slots.iter();
        let mut entries = Vec::new();
        for (i, binding) in kernel.bindings.iter().enumerate() {
            let resource = match binding {
                Binding::Uniform { bytes } => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer: self.uniforms.expect("a plan with uniform blocks has a uniform buffer"),
                    offset: run.uniform_offset.into(),
                    size: std::num::NonZeroU64::new((*bytes).into()),
                }),
                _ => {
                    let slot = slots.next().expect("a plan names a slot for each binding");
                    match &self.memory[slot.0 as usize] {
                        Memory::Texture { view, .. } => wgpu::BindingResource::TextureView(view),
                        Memory::Buffer(buffer) => buffer.as_entire_binding(),
                    }
                }
            };
            entries.push(wgpu::BindGroupEntry { binding: i as u32, resource });
        }
        // The slot that is left is the target that points are drawn into.
        let target = slots.next().map(|slot| match &self.memory[slot.0 as usize] {
            Memory::Texture { view, .. } => view.clone(),
            Memory::Buffer(_) => unreachable!("points are drawn into images"),
        });
        let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&run.name),
            layout: &pipeline.layout,
            entries: &entries,
        });
        let clears = run.clears.iter().filter(|_| target.is_none()).map(|slot| buffer(self.memory, *slot).clone()).collect();
        ReadyRun { name: run.name.clone(), pipeline, group, groups: run.groups, clears, target }
    }
}

impl Ready {
    fn record(&self, recorder: &mut Recorder<'_>, transfer: &mut Transfer, memory: &[Memory]) -> Result<(), GpuError> {
        match self {
            Self::Run(run) => recorder.run(run),
            Self::Repeat(r) => r.record(recorder, transfer, memory),
        }
    }
}

impl ReadyRepeat {
    fn record(&self, recorder: &mut Recorder<'_>, transfer: &mut Transfer, memory: &[Memory]) -> Result<(), GpuError> {
        let (most, until) = match self.repeat.count {
            Times::Fixed(n) => (n, None),
            Times::Until { value, limit, every, max } => (max, Some((value, limit, every))),
        };
        let mut last = 0;
        for i in 0..most {
            let body = match i {
                0 => &self.first,
                i if i % 2 == 1 => &self.odd,
                _ => &self.even,
            };
            for step in body {
                step.record(recorder, transfer, memory)?;
            }
            last = i;
            recorder.progress(i + 1, most);
            if let Some((value, limit, every)) = until
                && (i + 1) % every == 0
            {
                recorder.submit()?;
                let slot = value[(i % 2) as usize];
                let mut now = f32::NAN;
                transfer.download(recorder.device(), &[(buffer(memory, slot), 4)], recorder.deadline(), |_, bytes| {
                    now = f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
                })?;
                if now < limit {
                    break;
                }
            }
        }
        if until.is_some() && last % 2 == 0 {
            for (from, to) in &self.repeat.settle {
                recorder.copy(|encoder| copy(encoder, &memory[from.0 as usize], &memory[to.0 as usize]));
            }
        }
        Ok(())
    }
}

impl RunOptions<'_> {
    pub(crate) fn cancelled(&self) -> bool {
        self.cancel.is_some_and(|c| c.load(Ordering::Relaxed))
    }
}

impl Prepared {
    /// The plan.
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// How many pipelines it uses.
    pub fn pipeline_count(&self) -> usize {
        self.pipelines.len()
    }
}

impl Drop for Executor {
    fn drop(&mut self) {
        // Work in flight ends before its memory goes; a lost device answers at once.
        let _ = wait(&self.device, None, Some(Instant::now() + Duration::from_secs(5)), "exit");
    }
}
