//! Records launches into command buffers and decides when to submit them.
//!
//! A submission should hold some tens of milliseconds of GPU work: long enough that its own cost vanishes, short
//! enough that no watchdog fires and that a cancelled run ends at once. What a launch costs is learned from the
//! submissions it was part of, for each launch on its own, because a plan mixes launches of microseconds and of
//! seconds. At most two submissions are in flight: the device works on one while the host records the next. So neither
//! memory nor latency grows with the number of iterations. Software renderers get one at a time: Mesa's blocks inside
//! the second submission until the first is done, where no timeout and no interrupt can reach.
//!
//! Rejected: a fixed number of launches a submission (either a watchdog fires or 17 µs launches drown in submissions);
//! one average cost for all (a loop of cheap passes behind it makes the next expensive one a submission of minutes).

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use indexmap::IndexMap;
use pipe_graph::pass::Profile;
use pipe_plan::plan::Times;

use crate::device::Device;
use crate::error::GpuError;
use crate::execute::RunOptions;
use crate::patience::Patience;
use crate::pipelines::Compiled;
use crate::prepare::{Costs, Ready, ReadyRepeat, ReadyRun};
use crate::stopwatch::Stopwatch;
use crate::transfer::Transfer;

/// GPU nanoseconds that one submission should hold.
const AIM: f64 = 30e6;

/// Most launches in one submission, whatever they take.
const MOST_LAUNCHES: u32 = 4096;

/// Most passes that an error message names.
const MOST_NAMES: usize = 6;

/// Time between two reports of progress.
const REPORT: Duration = Duration::from_millis(100);

/// Records one run of a plan.
pub(crate) struct Recorder<'a> {
    device: &'a Device,
    transfer: &'a mut Transfer,
    names: &'a [String],
    options: RunOptions<'a>,
    patience: Patience<'a>,
    encoder: Option<wgpu::CommandEncoder>,
    pass: Option<wgpu::ComputePass<'static>>,
    batch: Batch,
    in_flight: VecDeque<(wgpu::SubmissionIndex, Instant, Batch)>,
    last_done: Instant,
    costs: Costs,
    stopwatch: Option<Stopwatch>,
    /// How many submissions may be in flight when another one is made.
    ahead: usize,
    /// How many loops are running, one in the other.
    depth: u32,
    reported: Instant,
    /// Workgroups of the launches from an id on, where they differ from what was prepared.
    groups: Option<(usize, &'a [[u32; 3]])>,
}

/// What a submission holds.
#[derive(Default)]
struct Batch {
    launches: u32,
    /// Expected GPU time, in nanoseconds.
    cost: f64,
    /// Which launches, each once, in the order of first launch.
    ids: Vec<usize>,
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(
        device: &'a Device,
        transfer: &'a mut Transfer,
        names: &'a [String],
        costs: Costs,
        options: RunOptions<'a>,
        patience: Patience<'a>,
    ) -> Self {
        let now = Instant::now();
        Self {
            device,
            transfer,
            names,
            options,
            patience,
            encoder: None,
            pass: None,
            batch: Batch::default(),
            in_flight: VecDeque::new(),
            last_done: now,
            costs,
            stopwatch: options.profile.then(|| Stopwatch::new(device)),
            ahead: usize::from(device.limits().profile == Profile::Gpu),
            depth: 0,
            reported: now,
            groups: None,
        }
    }

    /// With these workgroups for the launches from an id on.
    pub(crate) fn with_groups(mut self, first_id: usize, groups: &'a [[u32; 3]]) -> Self {
        self.groups = Some((first_id, groups));
        self
    }

    /// Records a step, submitting as it goes.
    pub(crate) fn step(&mut self, step: &Ready) -> Result<(), GpuError> {
        match step {
            Ready::Run(run) => self.run(run),
            Ready::Repeat(repeat) => self.repeat(repeat),
            Ready::Tiles(_) => unreachable!("tiles stand outside all other steps, and are run by the executor"),
        }
    }

    /// Submits the rest and waits for everything. Answers GPU times where they were measured, and what was learned.
    pub(crate) fn finish(mut self) -> Result<(IndexMap<String, f64>, Costs), GpuError> {
        self.submit()?;
        self.drain(0)?;
        Ok((self.stopwatch.map(Stopwatch::into_times).unwrap_or_default(), self.costs))
    }

    fn repeat(&mut self, repeat: &ReadyRepeat) -> Result<(), GpuError> {
        self.depth += 1;
        let (most, until) = match repeat.count {
            Times::Fixed(n) => (n, None),
            Times::Until { limit, every, max, .. } => (max, repeat.values.as_ref().map(|values| (values, limit, every.max(1)))),
        };
        let mut last = 0;
        for i in 0..most {
            let steps = match i {
                0 => &repeat.first,
                i if i % 2 == 1 => &repeat.odd,
                _ => &repeat.even,
            };
            steps.iter().try_for_each(|step| self.step(step))?;
            last = i;
            self.progress(i + 1, most);
            if let Some((values, limit, every)) = until
                && (i + 1) % every == 0
                && i + 1 < most
            {
                let value = self.read_float(&values[(i % 2) as usize], &repeat.name)?;
                // NaN is not below anything.
                if value < limit {
                    break;
                }
            }
        }
        if until.is_some() && last % 2 == 0 {
            for (from, to) in &repeat.settle {
                from.copy_to(to, self.encoder());
            }
        }
        self.depth -= 1;
        Ok(())
    }

    /// The first float of a buffer, as the launches so far leave it.
    fn read_float(&mut self, buffer: &wgpu::Buffer, node: &str) -> Result<f32, GpuError> {
        self.submit()?;
        self.drain(0)?;
        let mut value = f32::NAN;
        self.transfer.download(self.device, &[(buffer, 4)], &self.patience, node, &mut |_, _, bytes| {
            if let Some(bytes) = bytes.first_chunk() {
                value = f32::from_le_bytes(*bytes);
            }
        })?;
        // The device was idle meanwhile; that is no cost of what comes next.
        self.last_done = Instant::now();
        Ok(value)
    }

    /// Reports the outermost loop.
    fn progress(&mut self, done: u32, of: u32) {
        let Some(progress) = self.options.progress.filter(|_| self.depth == 1) else { return };
        if done == of || self.reported.elapsed() >= REPORT {
            progress(done, of);
            self.reported = Instant::now();
        }
    }

    /// The encoder, between passes.
    fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        self.pass = None;
        let device = self.device;
        self.encoder.get_or_insert_with(|| device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default()))
    }

    fn run(&mut self, run: &ReadyRun) -> Result<(), GpuError> {
        let groups = self.groups.map_or(run.groups, |(first, groups)| groups[run.id - first]);
        if groups.contains(&0) {
            return Ok(());
        }
        let cost = self.costs.0[run.id];
        if self.batch.launches > 0 && (self.batch.cost + cost > AIM || self.batch.launches >= MOST_LAUNCHES) {
            self.submit()?;
        }
        for memory in &run.clears {
            memory.zero(self.encoder());
        }
        let name = &self.names[run.id];
        let stamp = self.stopwatch.as_mut().and_then(|s| s.start(name));
        match (&run.pipeline.launch, &run.target) {
            (Compiled::Points(pipeline), Some(target)) => self.draw(run, pipeline, target, name, stamp.as_ref()),
            (Compiled::Compute(pipeline), _) => self.dispatch((run, groups), pipeline, name, stamp.as_ref()),
            (Compiled::Points(_), None) => unreachable!("preparing points looks for their target"),
        }
        self.batch.launches += 1;
        self.batch.cost += cost;
        if !self.batch.ids.contains(&run.id) {
            self.batch.ids.push(run.id);
        }
        if self.stopwatch.as_ref().is_some_and(Stopwatch::by_hand) {
            self.submit()?;
            let started = Instant::now();
            self.drain(0)?;
            if let Some(s) = &mut self.stopwatch {
                s.add(name, started.elapsed().as_secs_f64() * 1e3);
            }
        } else if self.stopwatch.as_ref().is_some_and(Stopwatch::full) {
            self.submit()?;
        }
        Ok(())
    }

    fn draw(
        &mut self,
        run: &ReadyRun,
        pipeline: &wgpu::RenderPipeline,
        view: &wgpu::TextureView,
        name: &str,
        stamp: Option<&(wgpu::QuerySet, u32)>,
    ) {
        let timestamp_writes = stamp.map(|(query_set, i)| wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(*i),
            end_of_pass_write_index: Some(i + 1),
        });
        let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store };
        let mut pass = self.encoder().begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(name),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops })],
            timestamp_writes,
            ..Default::default()
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &run.group, &[]);
        pass.draw(0..run.groups[0], 0..1);
    }

    fn dispatch(
        &mut self,
        (run, [x, y, z]): (&ReadyRun, [u32; 3]),
        pipeline: &wgpu::ComputePipeline,
        name: &str,
        stamp: Option<&(wgpu::QuerySet, u32)>,
    ) {
        if stamp.is_some() {
            self.pass = None;
        }
        let device = self.device;
        let encoder = self.encoder.get_or_insert_with(|| device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default()));
        let pass = self.pass.get_or_insert_with(|| {
            let timestamp_writes = stamp.map(|(query_set, i)| wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(*i),
                end_of_pass_write_index: Some(i + 1),
            });
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes }).forget_lifetime()
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &run.group, &[]);
        pass.dispatch_workgroups(x, y, z);
    }

    /// Sends what is recorded on its way, once few enough submissions are in flight.
    fn submit(&mut self) -> Result<(), GpuError> {
        self.pass = None;
        let batch = std::mem::take(&mut self.batch);
        let Some(mut encoder) = self.encoder.take() else { return Ok(()) };
        let node = self.describe(&batch);
        self.drain(self.ahead)?;
        self.patience.check(&node)?;
        if let Some(s) = &self.stopwatch {
            s.resolve(&mut encoder);
        }
        let submitted = Instant::now();
        let index = self.device.queue.submit([encoder.finish()]);
        self.device.check(&node)?;
        self.in_flight.push_back((index, submitted, batch));
        if self.stopwatch.is_some() {
            self.drain(0)?;
        }
        if let Some(s) = &mut self.stopwatch {
            s.read(self.device, &self.patience)?;
        }
        Ok(())
    }

    /// Waits until at most `left` submissions are in flight, and learns what launches cost.
    fn drain(&mut self, left: usize) -> Result<(), GpuError> {
        while self.in_flight.len() > left {
            let Some((index, submitted, batch)) = self.in_flight.pop_front() else { return Ok(()) };
            self.patience.wait(self.device, Some(&index), &self.describe(&batch))?;
            let now = Instant::now();
            let took = (now - self.last_done.max(submitted)).as_nanos() as f64;
            self.last_done = now;
            if batch.cost > 0.0 {
                // Learned gently: the first launches of a pipeline take longer than the others.
                let ratio = (took / batch.cost).clamp(0.125, 8.0);
                batch.ids.iter().for_each(|id| self.costs.0[*id] = (self.costs.0[*id] * ratio).max(500.0));
            }
        }
        Ok(())
    }

    /// The passes of a submission, for messages.
    fn describe(&self, batch: &Batch) -> String {
        let mut names: Vec<&str> = Vec::new();
        for id in &batch.ids {
            if !names.contains(&self.names[*id].as_str()) {
                names.push(&self.names[*id]);
            }
        }
        let more = names.len().saturating_sub(MOST_NAMES);
        names.truncate(MOST_NAMES);
        let all = names.join("`, `");
        if more > 0 { format!("{all}` and {more} more `…") } else { all }
    }
}
