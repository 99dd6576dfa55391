//! `run`: files through a graph, once or for every frame.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use indexmap::IndexMap;
use pipe::Failure;
use pipe::decode::Decoder;
use pipe::frames::{Sequence, run_sequence};
use pipe::project::{Project, World};
use pipe::run::{Job, Report, Session, input_kinds};
use pipe_graph::document::Document;
use pipe_graph::graph::Graph;
use pipe_graph::node::Loader as _;
use pipe_graph::resolve::Request;
use pipe_graph::types::{EdgeKind, EdgeType};
use pipe_io::atomic::AtomicFile;
use pipe_io::mesh::MeshFormat;
use pipe_io::sequence::{FrameRange, Pattern};
use pipe_io::volume::VolumeFormat;
use pipe_io::{Source, Target};

use super::args::{self, RunArgs};
use super::targets::refuse_clashes;
use super::{cache_folder, colour, device_choice, output};

/// Runs the graph.
pub(super) fn run(a: &RunArgs) -> Result<(), Failure> {
    let cancel = interrupt_flag()?;
    let mut job = args::job(a)?;
    let mut project = Project::open(&a.graph)?;
    let Some(document) = project.document.clone() else { return Err(project.failure(colour())) };
    bind(&mut job, &document, a)?;
    let frames = frames(a, &job)?;
    check_early(&mut project, &job, a, frames)?;
    let choice = device_choice(a.device.device.as_deref());
    let cache = cache_folder();
    match frames {
        Some(frames) => {
            let mut session = Session::open(&choice, cache.as_deref())?;
            let sequence = Sequence { frames, resume: a.resume, skip_bad: a.skip_bad_frames };
            let bar = output::progress(frames.into_iter().count() as u64, "frames");
            let outcome = run_sequence(
                &mut session,
                &job,
                &sequence,
                &cancel,
                &|message| {
                    bar.suspend(|| output::say(message));
                },
                &|frame, report| {
                    bar.inc(1);
                    report.map_or(Ok(()), |report| write_reports(a, report, Some(frame)))
                },
            )?;
            bar.finish_and_clear();
            output::say(&format!("{} frames written, {} skipped", outcome.written, outcome.skipped));
            outcome.last.map_or(Ok(()), |report| write_reports(a, &report, None))
        }
        None => {
            let kinds = input_kinds(&mut project);
            let started = Instant::now();
            // The device opens while the inputs are decoded.
            let (session, inputs) = std::thread::scope(|scope| {
                let opening = scope.spawn(|| Session::open(&choice, cache.as_deref()));
                let inputs = Decoder::default().inputs(&job, &kinds);
                (opening.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), inputs)
            });
            let (mut session, inputs) = (session?, inputs?);
            let decoded = started.elapsed().as_secs_f64() * 1e3;
            let bar = output::progress(1, "steps");
            let tell = |done: u32, of: u32| {
                bar.set_length(of.into());
                bar.set_position(done.into());
            };
            let finished = session.execute(&job, &inputs, Some(&cancel), Some(&tell));
            bar.finish_and_clear();
            let mut finished = finished?;
            finished.report.wall.decode = decoded;
            finished.report.wall.total += decoded;
            if cancel.load(Ordering::Relaxed) {
                return Err(Failure::Interrupted);
            }
            let report = finished.write()?;
            output::say(&report.warnings);
            if output::verbose() {
                output::say(&describe(&report));
            }
            write_reports(a, &report, None)
        }
    }
}

/// Set by Ctrl-C. The second one ends the process at once; temporary files are the worst that is left.
fn interrupt_flag() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    let set = flag.clone();
    ctrlc::set_handler(move || {
        if set.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .map_err(|e| Failure::World(format!("cannot watch for interrupts: {e}")))?;
    Ok(flag)
}

/// Binds positional files and `-i`, `-o` to the graph's inputs and outputs.
pub(super) fn bind(job: &mut Job, document: &Document, a: &RunArgs) -> Result<(), Failure> {
    let inputs: Vec<&str> = document.inputs.iter().map(|i| i.name.value.as_str()).collect();
    let outputs: Vec<&str> = document.outputs.iter().map(|(n, _)| n.value.as_str()).collect();
    let known = |name: &str, all: &[&str], what: &str| {
        if all.contains(&name) {
            return Ok(());
        }
        let list = if all.is_empty() { "none".to_owned() } else { all.join(", ") };
        Err(Failure::Graph(format!("the graph has no {what} `{name}`; it has: {list}")))
    };
    for text in &a.input {
        let (name, file) = args::pair(text, "-i")?;
        known(&name, &inputs, "input")?;
        once("input", &name, job.inputs.get(&name), &file)?;
        job.bind_input(&name, &file);
    }
    for text in &a.output {
        let (name, file) = args::pair(text, "-o")?;
        known(&name, &outputs, "output")?;
        once("output", &name, job.outputs.get(&name), &file)?;
        job.bind_output(&name, &file)?;
    }
    let open_inputs: Vec<&str> = inputs.iter().copied().filter(|n| !job.inputs.contains_key(*n)).collect();
    let open_outputs: Vec<&str> = outputs.iter().copied().filter(|n| !job.outputs.contains_key(*n)).collect();
    let mut files = a.files.iter();
    match (open_inputs.as_slice(), a.files.len()) {
        ([], _) => {}
        ([one], 1..) => job.bind_input(one, files.next().expect("there is one")),
        (open, _) => {
            return Err(Failure::Graph(format!(
                "no file is bound to the input{} {}\n  next: give each as -i NAME=FILE",
                if open.len() > 1 { "s" } else { "" },
                open.join(", ")
            )));
        }
    }
    match (open_outputs.as_slice(), files.len()) {
        (_, 0) => {}
        // With several outputs the first one that the graph names is meant.
        ([one, ..], 1) => job.bind_output(one, files.next().expect("there is one"))?,
        (_, _) => {
            let extra: Vec<&str> = files.map(String::as_str).collect();
            return Err(Failure::Graph(format!(
                "do not know what to do with {}\n  next: bind files by name: -i NAME=FILE, -o NAME=FILE",
                extra.join(" ")
            )));
        }
    }
    if job.outputs.is_empty() && job.dumps.is_empty() && !document.outputs.is_empty() && !has_readback(document) {
        return Err(Failure::Graph(format!(
            "no file is bound to the output {}\n  next: give one as the last argument, or as -o NAME=FILE",
            open_outputs.join(", ")
        )));
    }
    Ok(())
}

fn has_readback(document: &Document) -> bool {
    document.nodes.iter().any(|c| c.kind.value == "Readback" || c.options.is_some())
}

/// Whether a file's name ends as those of tables, volumes and meshes do.
fn is_no_image(file: &str) -> bool {
    let path = Path::new(file);
    let table = ["csv", "json", "npy", "svg"].iter().any(|e| file.to_lowercase().ends_with(e));
    table || VolumeFormat::of_name(path).is_some() || MeshFormat::of(path).is_ok()
}

/// Tells mistakes and clashes before anything large is read.
fn check_early(project: &mut Project, job: &Job, a: &RunArgs, frames: Option<FrameRange>) -> Result<(), Failure> {
    for file in job.outputs.values() {
        if !is_no_image(file) {
            Target::parse(file)?;
        }
    }
    let broken = project.diagnostics.has_errors();
    let (graph, world) = foresee(project, job, frames)?;
    // Some sizes may be unknown here, so only what is wrong at any size may end the run; sizes are checked with the pixels.
    if broken || (job.inputs.is_empty() && graph.is_none()) {
        return Err(project.failure(colour()));
    }
    refuse_clashes(job, a, graph.as_ref(), &world, frames)
}

/// Resolves with the sizes in the files' headers, where they can be read cheaply; the world has then seen what files the graph
/// names.
pub(super) fn foresee(project: &mut Project, job: &Job, frames: Option<FrameRange>) -> Result<(Option<Graph>, World), Failure> {
    let world = World::new(job.read);
    let request = Request { inputs: sizes(project, job, frames)?, settings: job.settings.clone(), frame: job.frame, ..Request::default() };
    let graph = project.resolve(&request, &world);
    Ok((graph, world))
}

/// The types of the inputs, as far as files say so cheaply: a pipe can be read once only.
fn sizes(project: &mut Project, job: &Job, frames: Option<FrameRange>) -> Result<IndexMap<String, EdgeType>, Failure> {
    let (world, kinds) = (World::new(job.read), input_kinds(project));
    let mut types = IndexMap::new();
    for (name, file) in &job.inputs {
        let pattern = Pattern::parse(file)?;
        let file = frames.zip(pattern).map_or_else(|| file.clone(), |(frames, pattern)| pattern.name(frames.first));
        let path = Path::new(&file);
        let ty = match kinds.get(name) {
            _ if !Source::parse(&file).path.is_some_and(|path| path.is_file()) => None,
            Some(EdgeKind::Image) => world.image(path).ok().map(EdgeType::Image),
            Some(EdgeKind::Volume) => world.volume(path).ok().map(EdgeType::Volume),
            _ => None,
        };
        types.extend(ty.map(|ty| (name.clone(), ty)));
    }
    Ok(types)
}

/// A port takes one file.
fn once(what: &str, name: &str, before: Option<&String>, file: &str) -> Result<(), Failure> {
    match before {
        Some(before) => Err(Failure::Graph(format!("the {what} `{name}` is given twice: {before} and {file}\n  next: keep one of them"))),
        None => Ok(()),
    }
}

/// The frames to run, when inputs or outputs are patterns.
fn frames(a: &RunArgs, job: &Job) -> Result<Option<FrameRange>, Failure> {
    let mut pattern = None;
    for file in job.inputs.values().chain(job.outputs.values()) {
        if Pattern::parse(file)?.is_some() {
            pattern = Some(file.clone());
        }
    }
    match (&a.frames, pattern) {
        (Some(text), _) => Ok(Some(text.parse()?)),
        (None, Some(file)) => Err(Failure::Graph(format!("{file} is a sequence\n  next: say which frames with --frames A-B"))),
        (None, None) => Ok(None),
    }
}

pub(super) fn describe(r: &Report) -> String {
    let w = &r.wall;
    format!(
        "{} on {}: decode {:.0} ms, plan {:.0}, upload {:.0}, compute {:.0}, readback {:.0}, encode {:.0}, all {:.0} ms; {}; {:.1} MiB on the device",
        r.size.iter().map(u32::to_string).collect::<Vec<_>>().join("x"),
        r.device,
        w.decode,
        w.plan,
        w.upload,
        w.compute,
        w.readback,
        w.encode,
        w.total,
        passes(r),
        r.peak_bytes as f64 / f64::from(1 << 20)
    )
}

/// How many passes ran, and how many did not have to.
pub(super) fn passes(r: &Report) -> String {
    match (r.passes_run, r.passes_kept) {
        (run, 0) => format!("{run} passes ran"),
        (run, kept) => format!("{run} of {} passes ran, {kept} kept", run + kept),
    }
}

/// Writes the reports that belong to a frame, or with `None` those that belong to the run: in a sequence to its last frame.
fn write_reports(a: &RunArgs, report: &Report, frame: Option<u32>) -> Result<(), Failure> {
    let save = |path: &Path, value: &dyn Fn() -> serde_json::Value| {
        let name = path.to_string_lossy();
        let pattern = if a.frames.is_some() { Pattern::parse(&name)? } else { None };
        let path = match (pattern, frame) {
            (Some(pattern), Some(frame)) => pattern.path(frame),
            (None, None) => path.to_owned(),
            _ => return Ok(()),
        };
        let text = serde_json::to_string_pretty(&value()).unwrap_or_default() + "\n";
        AtomicFile::write_whole((path.as_os_str() != "-").then_some(path.as_path()), text.as_bytes())
            .map_err(|e| Failure::World(format!("cannot write `{}`: {e}", path.display())))
    };
    if let Some(path) = &a.stats {
        save(path, &|| report.to_json())?;
    }
    if let Some(path) = &a.trace {
        save(path, &|| trace(report))?;
    }
    Ok(())
}

/// The stages and passes one after another, in the trace event format.
fn trace(r: &Report) -> serde_json::Value {
    let mut events = Vec::new();
    let mut at = 0.0;
    let w = &r.wall;
    for (name, ms) in [
        ("decode", w.decode),
        ("plan", w.plan),
        ("upload", w.upload),
        ("compute", w.compute),
        ("readback", w.readback),
        ("encode", w.encode),
    ] {
        events.push(serde_json::json!({"name": name, "ph": "X", "ts": at * 1e3, "dur": ms * 1e3, "pid": 1, "tid": 1}));
        if name == "compute" {
            let mut inner = at;
            for (pass, ms) in &r.passes {
                events.push(serde_json::json!({"name": pass, "ph": "X", "ts": inner * 1e3, "dur": ms * 1e3, "pid": 1, "tid": 2}));
                inner += ms;
            }
        }
        at += ms;
    }
    serde_json::json!({"traceEvents": events, "displayTimeUnit": "ms"})
}
