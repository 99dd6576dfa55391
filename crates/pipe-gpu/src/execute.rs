//! Plan → outputs.
//!
//! Everything that a plan needs is made once ([`Executor::prepare`]): pipelines, memory, bind groups. A run then only
//! uploads, records launches, and brings back. What outlives a plan (pipelines, memory that the next plan can use,
//! staging buffers, values of earlier frames) belongs to the executor.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indexmap::IndexMap;
use pipe_plan::plan::{Crossing, Plan, SlotId, Step, Tile, Upload};

use crate::device::Device;
use crate::error::GpuError;
use crate::history::Histories;
use crate::memo::{self, Act, Course, Key};
use crate::patience::Patience;
use crate::pipelines::Pipelines;
use crate::prepare::{Memo, Prepared, Ready, ReadyTiles, kernel_names};
use crate::record::Recorder;
use crate::storage::{self, Memory, Pool};
use crate::tiles::{self, Exchange, InMemory};
use crate::transfer::{Transfer, copy_out};

/// How to run.
#[derive(Clone, Copy, Default)]
pub struct RunOptions<'a> {
    /// Bounds the whole run, transfers and GPU work; of what is made in tiles each tile.
    pub timeout: Option<Duration>,
    /// Measure the GPU time of every pass. Passes then run one by one.
    pub profile: bool,
    /// Set from outside to end the run early; it is looked at several times a second.
    pub cancel: Option<&'a AtomicBool>,
    /// Told now and then: iterations recorded and to do of the outermost loop that is running.
    pub progress: Option<&'a (dyn Fn(u32, u32) + Sync)>,
    /// Leave out what the device still holds from earlier runs. Inputs are then hashed instead of uploaded blindly.
    pub keep: bool,
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
    /// GPU milliseconds by pass name, summed over iterations, in the order of first launch; empty unless profiled.
    pub passes: IndexMap<String, f64>,
    /// How many of the plan's passes ran; a loop counts as one.
    pub passes_run: usize,
    /// How many were left out, since the device still held what they would have made.
    pub passes_kept: usize,
}

/// What came back.
#[derive(Debug, Default)]
pub struct Outputs {
    /// Bytes by the name of the fetch.
    pub fetched: IndexMap<String, Vec<u8>>,
    /// Where the time went.
    pub timings: Timings,
}

/// Bytes of a fetch on their way to the caller, in mapped memory.
#[derive(Debug)]
pub struct Part<'a> {
    /// Name of the fetch.
    pub name: &'a str,
    /// Where they lie in the whole.
    pub range: Range<u64>,
    /// The bytes, `range.end - range.start` of them.
    pub bytes: &'a [u8],
}

/// Runs plans on one device.
pub struct Executor {
    device: Device,
    pipelines: Pipelines,
    pool: Pool,
    transfer: Transfer,
    histories: Histories,
    budget: Option<u64>,
    /// What each input was in the last run, by name.
    inputs: HashMap<String, Key>,
}

impl Executor {
    /// An executor; `cache` is a folder for compiled pipelines, made when there is none.
    pub fn new(device: Device, cache: Option<&Path>) -> Self {
        let pipelines = cache.map(|folder| Pipelines::with_cache(&device, folder)).unwrap_or_default();
        let (pool, transfer, histories) = (Pool::default(), Transfer::new(), Histories::default());
        Self { device, pipelines, pool, transfer, histories, budget: None, inputs: HashMap::new() }
    }

    /// The device.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Bounds the bytes that a plan may take on the device; the budget that a plan itself names holds too.
    pub fn set_budget(&mut self, bytes: Option<u64>) {
        self.budget = bytes;
    }

    /// Makes everything that a plan needs. Nothing is allocated for a plan that cannot fit.
    pub fn prepare(&mut self, plan: Arc<Plan>) -> Result<Prepared, GpuError> {
        storage::check(&self.device, &plan, self.budget)?;
        if let Some(budget) = self.budget.into_iter().chain(plan.limits.budget).min() {
            self.transfer.fit(budget - storage::bytes_needed(&plan));
        }
        let pipelines = self.pipelines.compile(&self.device, &plan.kernels, &kernel_names(&plan))?;
        let steps = memo::steps(&plan);
        // Inputs are most likely what they were; a wrong guess only takes memory with nothing useful in it.
        let acts = acts(&plan, &steps, |upload| self.inputs.get(&upload.name).map_or_else(memo::unique, |key| of_upload(*key, upload)));
        let useful = Course::new(&acts, plan.slots.len()).contents();
        let (memory, contents) = self.pool.take(&self.device, &plan, &useful)?;
        let uniforms = (!plan.uniforms.is_empty()).then(|| {
            let bytes = pad(&plan.uniforms);
            let buffer = self.device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("uniforms"),
                size: bytes.len() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            self.device.queue.write_buffer(&buffer, 0, &bytes);
            buffer
        });
        Prepared::new(&self.device, plan, memory, Memo { steps, contents: Mutex::new(contents) }, uniforms, &pipelines)
    }

    /// Takes over a plan that differs from the prepared one in uniforms and literals only, making nothing anew;
    /// `false`, and nothing done, when it differs in more.
    pub fn update(&mut self, prepared: &mut Prepared, plan: &Arc<Plan>) -> Result<bool, GpuError> {
        let old = &prepared.plan;
        if Arc::ptr_eq(old, plan) {
            return Ok(true);
        }
        let same = old.slots == plan.slots
            && old.kernels == plan.kernels
            && old.steps == plan.steps
            && old.fetches == plan.fetches
            && old.histories == plan.histories
            && old.uploads == plan.uploads
            && old.uniforms.len() == plan.uniforms.len()
            && old
                .literals
                .iter()
                .map(|(slot, bytes)| (slot, bytes.len()))
                .eq(plan.literals.iter().map(|(slot, bytes)| (slot, bytes.len())));
        if !same {
            return Ok(false);
        }
        if old.uniforms != plan.uniforms
            && let Some(buffer) = &prepared.uniforms
        {
            self.device.queue.write_buffer(buffer, 0, &pad(&plan.uniforms));
        }
        prepared.memo.steps = memo::steps(plan);
        prepared.plan = plan.clone();
        Ok(true)
    }

    /// Gives the memory of a prepared plan back, so that the next plan can use it.
    pub fn release(&mut self, prepared: Prepared) {
        let Prepared { plan, memory, memo, .. } = prepared;
        self.pool.give(&plan, memory, memo.contents.into_inner().unwrap_or_else(PoisonError::into_inner));
    }

    /// Forgets all values of earlier frames: the next frame is a first one.
    pub fn forget(&mut self) {
        self.histories.clear();
    }

    /// Uploads, runs, and brings back. `inputs` are the host's bytes of each external.
    pub fn run(&mut self, prepared: &Prepared, inputs: &HashMap<&str, &[u8]>, options: &RunOptions<'_>) -> Result<Outputs, GpuError> {
        let mut pictures = InMemory::new(inputs);
        let mut outputs = self.run_through(prepared, inputs, &mut pictures, options)?;
        outputs.fetched.extend(pictures.into_outputs());
        Ok(outputs)
    }

    /// Like [`Executor::run`], but what is made tile by tile goes through `exchange`.
    pub fn run_through(
        &mut self,
        prepared: &Prepared,
        inputs: &HashMap<&str, &[u8]>,
        exchange: &mut dyn Exchange,
        options: &RunOptions<'_>,
    ) -> Result<Outputs, GpuError> {
        let mut fetched = IndexMap::new();
        for fetch in &prepared.plan.fetches {
            let bytes = fetch.parts.iter().map(|(_, range)| range.end).max().unwrap_or(0);
            fetched.insert(fetch.name.clone(), vec![0; bytes as usize]);
        }
        let timings = self.run_into(prepared, inputs, exchange, options, &mut |part| {
            if let Some(whole) = fetched.get_mut(part.name) {
                copy_out(&mut whole[part.range.start as usize..part.range.end as usize], part.bytes);
            }
        })?;
        Ok(Outputs { fetched, timings })
    }

    /// Like [`Executor::run`], but hands the bytes that come back out as they arrive, still in mapped memory, without
    /// a copy: parts of a fetch in the order of the plan, each in one or more pieces. What is made tile by tile goes
    /// through `exchange`.
    pub fn run_into(
        &mut self,
        prepared: &Prepared,
        inputs: &HashMap<&str, &[u8]>,
        exchange: &mut dyn Exchange,
        options: &RunOptions<'_>,
        take: &mut dyn FnMut(Part<'_>),
    ) -> Result<Timings, GpuError> {
        let plan = &prepared.plan;
        let mut patience = Patience::new(options.timeout, options.cancel);
        let mut timings = Timings::default();

        let started = Instant::now();
        let sources = plan.uploads.iter().map(|upload| source(upload, inputs)).collect::<Result<Vec<_>, GpuError>>()?;
        if options.keep {
            self.inputs = inputs.iter().map(|(name, bytes)| ((*name).to_owned(), memo::of_bytes(bytes))).collect();
        } else {
            self.inputs.clear();
        }
        let acts = acts(plan, &prepared.memo.steps, |upload| {
            self.inputs.get(&upload.name).map_or_else(memo::unique, |key| of_upload(*key, upload))
        });
        // Should the run end early, nothing is known of the memory.
        let unknown = vec![None; plan.slots.len()];
        let mut contents = std::mem::replace(&mut *prepared.memo.contents.lock().unwrap_or_else(PoisonError::into_inner), unknown);
        let mut chosen = vec![false; acts.len()];
        if !options.keep {
            chosen[plan.literals.len()..].fill(true);
        }
        // What the host takes tile by tile is not there to be taken again.
        let given = acts.len() - plan.steps.len();
        plan.steps.iter().zip(&mut chosen[given..]).for_each(|(step, chosen)| *chosen |= matches!(step, Step::Tiles(_)));
        Course::new(&acts, plan.slots.len()).needed(&mut chosen, &wanted(plan), &mut contents);
        let (given, steps) = chosen.split_at(given);
        let (literals, uploads) = given.split_at(plan.literals.len());
        for ((slot, bytes), _) in plan.literals.iter().zip(literals).filter(|(_, chosen)| **chosen) {
            let (buffer, all) = (memory(prepared, *slot)?.buffer(&plan.name)?, 0..bytes.len() as u64);
            self.transfer.upload(&self.device, buffer, bytes, std::slice::from_ref(&all), &patience, &plan.name)?;
        }
        for ((upload, source), _) in plan.uploads.iter().zip(&sources).zip(uploads).filter(|(_, chosen)| **chosen) {
            let buffer = memory(prepared, upload.slot)?.buffer(&plan.name)?;
            self.transfer.upload(&self.device, buffer, source, &upload.ranges, &patience, &upload.name)?;
        }
        timings.upload_ms = millis(started);

        if let Some(overrun) = &prepared.overrun {
            self.device.queue.write_buffer(&overrun.buffer, 0, &[0; 4]);
        }
        self.histories.recall(&self.device, plan, &prepared.memory);
        let chosen: Vec<&Ready> = prepared.steps.iter().zip(steps).filter(|(_, chosen)| **chosen).map(|(step, _)| step).collect();
        for steps in chosen.chunk_by(|a, b| !matches!(a, Ready::Tiles(_)) && !matches!(b, Ready::Tiles(_))) {
            let run = Running { prepared, options, patience: &patience };
            match steps {
                [Ready::Tiles(tiles)] => {
                    self.tiles(&run, tiles, exchange, &mut timings)?;
                    patience = Patience::new(options.timeout, options.cancel);
                }
                _ => self.launch(&run, steps.iter().copied(), None, &mut timings)?,
            }
        }
        self.check_loops(prepared, &patience)?;
        timings.passes_run = chosen.len();
        timings.passes_kept = steps.len() - timings.passes_run;

        let started = Instant::now();
        self.histories.keep(&self.device, plan, &prepared.memory)?;
        let parts: Vec<_> = plan.fetches.iter().flat_map(|f| f.parts.iter().map(|(slot, range)| (f.name.as_str(), *slot, range))).collect();
        let one = |(_, slot, range): &(&str, _, &Range<u64>)| Ok((memory(prepared, *slot)?.buffer(&plan.name)?, range.end - range.start));
        let buffers = parts.iter().map(one).collect::<Result<Vec<_>, GpuError>>()?;
        self.transfer.download(&self.device, &buffers, &patience, &plan.name, &mut |i, at, bytes| {
            let (name, _, range) = parts[i];
            let start = range.start + at;
            take(Part { name, range: start..start + bytes.len() as u64, bytes });
        })?;
        timings.readback_ms += millis(started);
        *prepared.memo.contents.lock().unwrap_or_else(PoisonError::into_inner) = contents;
        Ok(timings)
    }

    /// An error where a user's shader said that its loops did not come to an end: what it made is wrong.
    fn check_loops(&mut self, prepared: &Prepared, patience: &Patience<'_>) -> Result<(), GpuError> {
        let Some(overrun) = &prepared.overrun else { return Ok(()) };
        let mut endless = false;
        self.transfer.download(&self.device, &[(&overrun.buffer, 4)], patience, &overrun.passes, &mut |_, _, bytes| {
            endless |= bytes.iter().any(|byte| *byte != 0);
        })?;
        if endless { Err(GpuError::Endless { node: overrun.passes.clone() }) } else { Ok(()) }
    }

    /// Records, submits and waits for steps; `groups` are those of a tile's launches, from an id on.
    fn launch<'s>(
        &mut self,
        run: &Running<'_>,
        steps: impl Iterator<Item = &'s Ready>,
        groups: Option<(usize, &[[u32; 3]])>,
        timings: &mut Timings,
    ) -> Result<(), GpuError> {
        let started = Instant::now();
        let Running { prepared, options, patience } = *run;
        let costs = prepared.costs.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let mut recorder = Recorder::new(&self.device, &mut self.transfer, &prepared.names, costs, *options, *patience);
        if let Some((first_id, groups)) = groups {
            recorder = recorder.with_groups(first_id, groups);
        }
        for step in steps {
            recorder.step(step)?;
        }
        let (passes, learned) = recorder.finish()?;
        *prepared.costs.lock().unwrap_or_else(PoisonError::into_inner) = learned;
        for (name, ms) in passes {
            *timings.passes.entry(name).or_default() += ms;
        }
        timings.compute_ms += millis(started);
        Ok(())
    }

    /// Runs the body for every tile. The time that a run may take is that of a tile here: reading and writing files between
    /// them takes as long as it takes.
    fn tiles(&mut self, run: &Running<'_>, tiles: &ReadyTiles, exchange: &mut dyn Exchange, timings: &mut Timings) -> Result<(), GpuError> {
        let Running { prepared, options, .. } = *run;
        let tiling = tiles::tiling(&prepared.plan, tiles.step)?;
        let mut encoder = self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        tiles.clears.iter().for_each(|memory| memory.zero(&mut encoder));
        self.device.queue.submit([encoder.finish()]);
        for (done, tile) in tiling.tiles.iter().enumerate() {
            let patience = Patience::new(options.timeout, options.cancel);
            self.tile(&Running { patience: &patience, ..*run }, tiles, tile, exchange, timings)?;
            if let Some(progress) = options.progress {
                progress(done as u32 + 1, tiling.tiles.len() as u32);
            }
        }
        Ok(())
    }

    /// Brings what a tile needs, runs the body, takes what it made.
    fn tile(
        &mut self,
        run: &Running<'_>,
        tiles: &ReadyTiles,
        tile: &Tile,
        exchange: &mut dyn Exchange,
        timings: &mut Timings,
    ) -> Result<(), GpuError> {
        let Running { prepared, patience, .. } = *run;
        let plan = &prepared.plan;
        let started = Instant::now();
        for from in &tile.uploads {
            let held = exchange.rows(from).map_err(GpuError::Exchange)?;
            let buffer = memory(prepared, from.slot)?.buffer(&plan.name)?;
            self.transfer.upload(&self.device, buffer, held.bytes, &from.ranges(&held.rows), patience, &from.name)?;
        }
        if let Some(buffer) = &prepared.uniforms {
            tiles::place(&self.device, plan, buffer, tile);
        }
        timings.upload_ms += millis(started);

        self.launch(run, tiles.body.iter(), Some((tiles.first_id, &tile.groups)), timings)?;
        self.check_loops(prepared, patience)?;

        let started = Instant::now();
        let mut taken: Vec<Vec<u8>> = tile.fetches.iter().map(|to| vec![0; to.bytes() as usize]).collect();
        let one = |to: &Crossing| Ok((memory(prepared, to.slot)?.buffer(&plan.name)?, to.bytes()));
        let buffers = tile.fetches.iter().map(one).collect::<Result<Vec<_>, GpuError>>()?;
        self.transfer.download(&self.device, &buffers, patience, &plan.name, &mut |i, at, bytes| {
            copy_out(&mut taken[i][at as usize..at as usize + bytes.len()], bytes);
        })?;
        timings.readback_ms += millis(started);
        tile.fetches.iter().zip(&taken).try_for_each(|(to, bytes)| exchange.put(to, bytes).map_err(GpuError::Exchange))
    }
}

/// What all parts of a run share.
#[derive(Clone, Copy)]
struct Running<'a> {
    prepared: &'a Prepared,
    options: &'a RunOptions<'a>,
    patience: &'a Patience<'a>,
}

/// All that a run does, in order: literals, uploads, recalled histories, steps.
fn acts(plan: &Plan, steps: &[Act], of_upload: impl Fn(&Upload) -> Key) -> Vec<Act> {
    let literals = plan.literals.iter().map(|(slot, bytes)| Act::fill(*slot, memo::of_bytes(bytes)));
    let uploads = plan.uploads.iter().map(|upload| Act::fill(upload.slot, of_upload(upload)));
    let recalled = plan.histories.iter().filter_map(|history| history.recall).map(|slot| Act::fill(slot, memo::unique()));
    let steps = plan.steps.iter().zip(steps).map(|(step, act)| if matches!(step, Step::Tiles(_)) { act.once() } else { act.clone() });
    literals.chain(uploads).chain(recalled).chain(steps).collect()
}

/// The key of what an upload takes from an input.
fn of_upload(input: Key, upload: &Upload) -> Key {
    memo::of((input, &upload.ranges))
}

/// The slots whose content at the end matters.
fn wanted(plan: &Plan) -> Vec<SlotId> {
    let fetched = plan.fetches.iter().flat_map(|fetch| fetch.parts.iter().map(|(slot, _)| *slot));
    fetched.chain(plan.histories.iter().map(|history| history.keep)).collect()
}

/// The bytes that an upload is made of.
fn source<'a>(upload: &Upload, inputs: &HashMap<&str, &'a [u8]>) -> Result<&'a [u8], GpuError> {
    let source = inputs.get(upload.name.as_str()).copied().unwrap_or_default();
    let wanted = upload.ranges.iter().map(|r| r.end).max().unwrap_or(0);
    if (source.len() as u64) < wanted {
        return Err(GpuError::ShortInput { name: upload.name.clone(), got: source.len() as u64, wanted });
    }
    Ok(source)
}

fn memory(prepared: &Prepared, slot: SlotId) -> Result<&Memory, GpuError> {
    let missing = || GpuError::Plan { node: prepared.plan.name.clone(), reason: format!("there is no slot {}", slot.0) };
    prepared.memory.get(slot.0 as usize).ok_or_else(missing)
}

fn millis(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

/// Uniform blocks start at multiples of 256, so the buffer ends at one.
fn pad(bytes: &[u8]) -> Vec<u8> {
    let mut padded = bytes.to_vec();
    padded.resize(bytes.len().next_multiple_of(256), 0);
    padded
}
