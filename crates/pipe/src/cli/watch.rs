//! `watch`: run again on every save of the graph, its shaders or its inputs.
//!
//! Files are looked at four times a second. That works on every file system, network ones included, and a graph has a
//! handful of files; a watcher of the operating system's would be one more dependency for nothing a person notices.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use pipe::Failure;
use pipe::project::Project;
use pipe::run::Session;

use super::args::{self, RunArgs};
use super::run::{bind, refuse_overwriting};
use super::{cache_folder, colour, device_choice, output};

/// Runs until interrupted.
pub(super) fn watch(a: &RunArgs) -> Result<(), Failure> {
    let mut session = Session::open(&device_choice(a.device.device.as_deref()), cache_folder().as_deref())?;
    let mut seen: Option<Vec<(PathBuf, Option<SystemTime>)>> = None;
    loop {
        let now = stamps(a);
        if seen.as_ref() != Some(&now) {
            // A file that is being written is left alone until it rests.
            if seen.is_some() {
                std::thread::sleep(Duration::from_millis(50));
            }
            seen = Some(stamps(a));
            match once(&mut session, a) {
                Ok(ms) => output::say(&format!("{}: {ms:.0} ms", a.graph)),
                Err(failure) => output::say(&failure.to_string()),
            }
        }
        std::thread::sleep(Duration::from_millis(250));
    }
}

fn once(session: &mut Session, a: &RunArgs) -> Result<f64, Failure> {
    let mut job = args::job(a)?;
    let project = Project::open(&a.graph)?;
    let Some(document) = project.document.clone() else { return Err(project.failure(colour())) };
    bind(&mut job, &document, a)?;
    refuse_overwriting(&job)?;
    Ok(session.run(&job)?.wall.total)
}

/// The files that matter, with their times: the graph, everything that lies beside it and is a graph or a shader, and
/// the inputs.
fn stamps(a: &RunArgs) -> Vec<(PathBuf, Option<SystemTime>)> {
    let mut files = vec![PathBuf::from(&a.graph)];
    let folder = Path::new(&a.graph).parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if let Ok(entries) = std::fs::read_dir(folder) {
        let beside = entries.flatten().map(|e| e.path());
        files.extend(beside.filter(|p| p.extension().is_some_and(|e| e == "ron" || e == "wgsl" || e == "cube")));
    }
    files.extend(a.files.iter().map(PathBuf::from));
    files.extend(a.input.iter().filter_map(|i| i.split_once('=')).map(|(_, f)| PathBuf::from(f)));
    // What the run itself writes must not start it again.
    if a.files.len() > 1 {
        let out = PathBuf::from(&a.files[a.files.len() - 1]);
        files.retain(|f| *f != out);
    }
    files.sort();
    files.dedup();
    let time = |f: &PathBuf| std::fs::metadata(f).and_then(|m| m.modified()).ok();
    files.into_iter().map(|f| (f.clone(), time(&f))).collect()
}
