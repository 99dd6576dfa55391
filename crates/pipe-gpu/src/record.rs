//! Records launches into command buffers and decides when to submit them.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use indexmap::IndexMap;

use crate::device::Device;
use crate::error::GpuError;
use crate::execute::{ReadyRun, RunOptions};
use crate::pipelines::Compiled;
use crate::transfer::wait;

/// GPU work that one submission should hold.
const AIM: Duration = Duration::from_millis(30);

/// Most launches in one submission, whatever they take.
const MOST_LAUNCHES: u32 = 4096;

/// Timestamps that one query set holds: two a launch.
const QUERIES: u32 = 512;

pub(crate) struct Recorder<'a> {
    device: &'a Device,
    options: RunOptions<'a>,
    deadline: Option<Instant>,
    encoder: Option<wgpu::CommandEncoder>,
    pass: Option<wgpu::ComputePass<'static>>,
    /// Launches since the last submission, and how many make a full one.
    launches: u32,
    full: u32,
    /// First pass of the current batch, for messages.
    first: String,
    in_flight: VecDeque<(wgpu::SubmissionIndex, u32, String)>,
    last_done: Instant,
    queries: Option<Queries>,
    times: IndexMap<String, f64>,
}

/// Timestamps of launches.
struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    names: Vec<String>,
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(device: &'a Device, options: RunOptions<'a>, deadline: Option<Instant>) -> Self {
        let queries = (options.profile && device.has_timestamps()).then(|| {
            let buffer = |usage| {
                device.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("timestamps"),
                    size: u64::from(QUERIES) * 8,
                    usage,
                    mapped_at_creation: false,
                })
            };
            Queries {
                set: device.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("timestamps"),
                    ty: wgpu::QueryType::Timestamp,
                    count: QUERIES,
                }),
                resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
                readable: buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
                names: Vec::new(),
            }
        });
        Self {
            device,
            options,
            deadline,
            encoder: None,
            pass: None,
            launches: 0,
            full: 64,
            first: String::new(),
            in_flight: VecDeque::new(),
            last_done: Instant::now(),
            queries,
            times: IndexMap::new(),
        }
    }

    pub(crate) fn device(&self) -> &'a Device {
        self.device
    }

    pub(crate) fn deadline(&self) -> Option<Instant> {
        self.deadline
    }

    /// GPU milliseconds by pass.
    pub(crate) fn into_times(self) -> IndexMap<String, f64> {
        self.times
    }

    pub(crate) fn progress(&self, done: u32, of: u32) {
        if let Some(progress) = self.options.progress {
            progress(done, of);
        }
    }

    fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        self.pass = None;
        let device = self.device;
        self.encoder.get_or_insert_with(|| device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default()))
    }

    /// Records something between passes.
    pub(crate) fn copy(&mut self, record: impl FnOnce(&mut wgpu::CommandEncoder)) {
        record(self.encoder());
    }

    pub(crate) fn run(&mut self, run: &ReadyRun) -> Result<(), GpuError> {
        if self.launches == 0 {
            self.first.clone_from(&run.name);
        }
        for buffer in &run.clears {
            self.encoder().clear_buffer(buffer, 0, None);
        }
        let stamp = self.queries.as_mut().map(|q| {
            q.names.push(run.name.clone());
            2 * (q.names.len() as u32 - 1)
        });
        if let (Compiled::Points(pipeline), Some(target)) = (&run.pipeline.launch, &run.target) {
            let set = self.queries.as_ref().map(|q| q.set.clone());
            let writes = set.as_ref().zip(stamp).map(|(query_set, i)| wgpu::RenderPassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(i),
                end_of_pass_write_index: Some(i + 1),
            });
            let encoder = self.encoder();
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(&run.name),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: target,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store },
                })],
                timestamp_writes: writes,
                ..Default::default()
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &run.group, &[]);
            pass.draw(0..run.groups[0], 0..1);
        } else if let Compiled::Compute(pipeline) = &run.pipeline.launch {
            let device = self.device;
            let encoder =
                self.encoder.get_or_insert_with(|| device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default()));
            if stamp.is_some() {
                self.pass = None;
            }
            let pass = self.pass.get_or_insert_with(|| {
                let writes = self.queries.as_ref().zip(stamp).map(|(q, i)| wgpu::ComputePassTimestampWrites {
                    query_set: &q.set,
                    beginning_of_pass_write_index: Some(i),
                    end_of_pass_write_index: Some(i + 1),
                });
                let desc = wgpu::ComputePassDescriptor { label: Some(&run.name), timestamp_writes: writes };
                encoder.begin_compute_pass(&desc).forget_lifetime()
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &run.group, &[]);
            let [x, y, z] = run.groups;
            pass.dispatch_workgroups(x, y, z);
        }
        self.launches += 1;
        let stamps_full = self.queries.as_ref().is_some_and(|q| 2 * q.names.len() as u32 >= QUERIES);
        if self.launches >= self.full || stamps_full {
            self.submit()?;
        }
        Ok(())
    }

    /// Sends what is recorded on its way, waiting while two submissions are in flight.
    pub(crate) fn submit(&mut self) -> Result<(), GpuError> {
        self.pass = None;
        if self.options.cancelled() {
            return Err(GpuError::Interrupted);
        }
        let Some(mut encoder) = self.encoder.take() else { return Ok(()) };
        let launches = std::mem::take(&mut self.launches);
        if let Some(q) = self.queries.as_ref().filter(|q| !q.names.is_empty()) {
            let n = 2 * q.names.len() as u32;
            encoder.resolve_query_set(&q.set, 0..n, &q.resolved, 0);
            encoder.copy_buffer_to_buffer(&q.resolved, 0, &q.readable, 0, u64::from(n) * 8);
        }
        let index = self.device.queue.submit([encoder.finish()]);
        self.device.check(&self.first)?;
        self.in_flight.push_back((index, launches, self.first.clone()));
        if self.queries.is_some() {
            self.drain(0)?;
            self.read_times()?;
        }
        self.drain(1)
    }

    /// Waits until at most `left` submissions are in flight, and learns how long a launch takes.
    fn drain(&mut self, left: usize) -> Result<(), GpuError> {
        while self.in_flight.len() > left {
            let (index, launches, node) = self.in_flight.pop_front().expect("longer than `left`");
            wait(self.device, Some(index), self.deadline, &node)?;
            let now = Instant::now();
            let each = (now - self.last_done).as_secs_f64() / f64::from(launches.max(1));
            self.last_done = now;
            let fits = (AIM.as_secs_f64() / each.max(1e-7)) as u32;
            // Grow gently: the first launches of a pipeline take longer than the others.
            self.full = fits.clamp(self.full / 4, self.full.saturating_mul(4)).clamp(1, MOST_LAUNCHES);
        }
        Ok(())
    }

    fn read_times(&mut self) -> Result<(), GpuError> {
        let Some(q) = &mut self.queries else { return Ok(()) };
        let n = q.names.len();
        if n == 0 {
            return Ok(());
        }
        q.readable.map_async(wgpu::MapMode::Read, 0..(n as u64) * 16, |_| {});
        wait(self.device, None, self.deadline, "timestamps")?;
        let period = f64::from(self.device.queue.get_timestamp_period());
        if let Ok(view) = q.readable.get_mapped_range(0..(n as u64) * 16) {
            let word = |i: usize| u64::from_le_bytes(view[i * 8..i * 8 + 8].try_into().expect("eight bytes"));
            for (i, name) in q.names.iter().enumerate() {
                let ms = word(2 * i + 1).wrapping_sub(word(2 * i)) as f64 * period / 1e6;
                *self.times.entry(name.clone()).or_default() += ms;
            }
        }
        q.readable.unmap();
        q.names.clear();
        Ok(())
    }

    /// Submits the rest and waits for everything.
    pub(crate) fn finish(&mut self) -> Result<(), GpuError> {
        self.submit()?;
        self.drain(0)
    }
}
