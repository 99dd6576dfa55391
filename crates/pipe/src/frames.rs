//! Sequences: every frame through the same graph, decode, GPU and encode overlapping.
//!
//! One thread decodes the frames ahead, this one runs them, one encodes those that are done; at most two frames wait
//! between them, so memory is bounded. The session keeps pipelines, memory and staging over all frames; an input that is the
//! same file in every frame is decoded once, and what is made of it alone stays on the device. An output that is one file of a format that moves (APNG, GIF) holds all frames.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::sync_channel;

use pipe_graph::resolve::Request;
use pipe_io::sequence::{FrameRange, Pattern};
use pipe_io::{Animation, Format, Target};
use pipe_plan::lower::Rim;

use crate::Failure;
use crate::decode::Decoder;
use crate::project::{Project, World};
use crate::run::{Finished, Inputs, Job, Report, Session, input_kinds, make_plan};

/// Which frames, and what to do about bad ones.
#[derive(Debug, Clone, Copy)]
pub struct Sequence {
    /// The frames.
    pub frames: FrameRange,
    /// Leave frames out whose outputs are there.
    pub resume: bool,
    /// Report a missing or broken frame and go on.
    pub skip_bad: bool,
}

/// What came of a sequence.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Frames written.
    pub written: u32,
    /// Frames left out.
    pub skipped: u32,
    /// What the last frame had to say.
    pub last: Option<Report>,
}

/// The job of one frame: patterns replaced by its files.
fn at_frame(job: &Job, frame: u32) -> Result<Job, Failure> {
    let mut job = job.clone();
    job.frame = f64::from(frame);
    // Where every input is another one in each frame, there is next to nothing to keep.
    let moves = |file: &String| Ok::<bool, Failure>(Pattern::parse(file)?.is_some());
    let moving = job.inputs.values().map(moves).collect::<Result<Vec<bool>, _>>()?;
    job.keep = moving.is_empty() || moving.contains(&false);
    let files = job.inputs.values_mut().chain(job.outputs.values_mut()).chain(job.dumps.values_mut());
    for file in files {
        if let Some(pattern) = Pattern::parse(file)? {
            *file = pattern.name(frame);
        }
    }
    Ok(job)
}

/// Whether frames need the ones before them: whether a plan for inputs of some size keeps anything.
fn remembers(project: &mut Project, session: &Session, job: &Job) -> bool {
    let request = Request { settings: job.settings.clone(), frame: job.frame, ..Request::default() };
    let graph = project.resolve(&request, &World::new(job.read));
    // Histories are those of the outputs that are asked for, and those are what a later frame has.
    let plan = graph.and_then(|graph| make_plan(&graph, &Rim::default(), &session.limits(), job).ok());
    plan.is_some_and(|plan| !plan.histories.is_empty())
}

/// The outputs that hold all frames in one file.
fn moving(job: &Job, sequence: &Sequence) -> Result<HashMap<Target, Animation>, Failure> {
    let count = sequence.frames.into_iter().count() as u32;
    let mut moving = HashMap::new();
    let dumps = job.dumps.values().map(|file| (file, false));
    for (file, is_output) in job.outputs.values().map(|file| (file, true)).chain(dumps) {
        if Pattern::parse(file)?.is_some() {
            continue;
        }
        match Target::parse(file) {
            Ok(target) if is_output && target.format.moves() => {
                if sequence.resume {
                    return Err(Failure::Graph(format!(
                        "{file} is written as a whole and cannot be resumed\n  next: run it without --resume"
                    )));
                }
                if sequence.skip_bad && target.format == Format::Apng {
                    return Err(Failure::Graph(format!(
                        "{file} announces its frames and cannot skip any\n  next: write a .gif, or run it without --skip-bad-frames"
                    )));
                }
                let animation = Animation::create(&target, count, job.rate, &job.write)?;
                moving.insert(target, animation);
            }
            _ if count > 1 => {
                let all = if is_output { ", or one for all: out.apng, out.gif" } else { "" };
                return Err(Failure::Graph(format!(
                    "every frame would be written to {file}\n  next: name a file for each frame with `####`, such as out.####.exr{all}"
                )));
            }
            _ => {}
        }
    }
    Ok(moving)
}

/// What is told of each frame that is done, with what there is to say about it unless it was skipped.
pub type Step<'a> = dyn Fn(u32, Option<&Report>) -> Result<(), Failure> + Sync + 'a;

/// Runs every frame.
pub fn run_sequence(
    session: &mut Session,
    job: &Job,
    sequence: &Sequence,
    cancel: &AtomicBool,
    say: &(dyn Fn(&str) + Sync),
    step: &Step<'_>,
) -> Result<Outcome, Failure> {
    let mut project = Project::open(&job.graph)?;
    let kinds = input_kinds(&mut project);
    if sequence.resume && remembers(&mut project, session, job) {
        return Err(Failure::Graph(
            "a graph with Feedback cannot be resumed: each frame needs the one before\n  next: run it without --resume".into(),
        ));
    }
    let mut moving = moving(job, sequence)?;
    let frames: Vec<u32> = sequence.frames.into_iter().collect();
    let count = frames.len() as u32;
    let skipped = &AtomicU32::new(0);
    let mut outcome = Outcome::default();

    std::thread::scope(|scope| {
        let (decoded_tx, decoded_rx) = sync_channel::<(u32, Result<(Job, Option<Inputs>), Failure>)>(1);
        let (finished_tx, finished_rx) = sync_channel::<(u32, Finished)>(1);
        let kinds = &kinds;
        scope.spawn(move || {
            let mut decoder = Decoder::default();
            for frame in frames {
                let mut read = || -> Result<(Job, Option<Inputs>), Failure> {
                    let job = at_frame(job, frame)?;
                    // An empty file is what a full disk leaves behind.
                    let there = |file: &String| std::fs::metadata(file).is_ok_and(|about| about.is_file() && about.len() > 0);
                    let done = sequence.resume && !job.outputs.is_empty() && job.outputs.values().all(there);
                    let inputs = if done { None } else { Some(decoder.inputs(&job, kinds)?) };
                    Ok((job, inputs))
                };
                if cancel.load(Ordering::Relaxed) || decoded_tx.send((frame, read())).is_err() {
                    return;
                }
            }
        });
        let encoder = scope.spawn(move || -> Result<(u32, Option<Report>), Failure> {
            let (mut written, mut last) = (0, None);
            while let Ok((frame, finished)) = finished_rx.recv() {
                let report = finished.write_into(&mut moving)?;
                written += 1;
                step(frame, Some(&report))?;
                last = Some(report);
            }
            // What has lost frames to a failure does not become a file.
            if written + skipped.load(Ordering::Relaxed) == count {
                moving.into_values().try_for_each(Animation::finish)?;
            }
            Ok((written, last))
        });
        let mut result = Ok(());
        let mut before = 0;
        for (frame, read) in decoded_rx {
            if cancel.load(Ordering::Relaxed) {
                result = Err(Failure::Interrupted);
                break;
            }
            let ran = read.and_then(|(mut job, inputs)| match inputs {
                None => Ok(None),
                Some(inputs) => {
                    job.frames_before = before;
                    session.execute(&job, &inputs, Some(cancel), None)?.at_frame(frame).map(Some)
                }
            });
            match ran {
                Ok(Some(finished)) => {
                    before += 1;
                    // The encoder ends early only after a failure, which is reported below.
                    if finished_tx.send((frame, finished)).is_err() {
                        break;
                    }
                }
                Ok(None) => {
                    skipped.fetch_add(1, Ordering::Relaxed);
                    step(frame, None)?;
                }
                Err(Failure::World(reason)) if sequence.skip_bad => {
                    say(&format!("warning: frame {frame} is skipped: {reason}"));
                    skipped.fetch_add(1, Ordering::Relaxed);
                    step(frame, None)?;
                }
                Err(Failure::World(reason)) => {
                    result = Err(Failure::World(format!("frame {frame}: {reason}\n  next: --skip-bad-frames goes on without it")));
                    break;
                }
                Err(other) => {
                    result = Err(other);
                    break;
                }
            }
        }
        drop(finished_tx);
        let encoded = encoder.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        let (written, last) = encoded?;
        outcome.written = written;
        outcome.last = last;
        result
    })?;
    outcome.skipped = skipped.load(Ordering::Relaxed);
    Ok(outcome)
}
