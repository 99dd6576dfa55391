//! `watch`: run again on every save of the graph, of what it includes, or of an input; only what changed.
//!
//! Files are looked at several times a second. That works on every file system, network ones included, and a graph has a
//! handful of files; a watcher of the operating system's would be one more dependency for nothing a person notices.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use pipe::Failure;
use pipe::project::Project;
use pipe::run::{Report, Session};

use super::args::{self, RunArgs};
use super::run::{bind, describe, foresee, passes};
use super::targets::refuse_clashes;
use super::{cache_folder, colour, device_choice, output};

/// Time between two looks at the files.
const LOOK: Duration = Duration::from_millis(200);

/// How a file looks from outside; `None` when it is not there.
type Stamp = Option<(SystemTime, u64)>;

/// Runs until interrupted.
pub(super) fn watch(a: &RunArgs) -> Result<(), Failure> {
    let mut session = Session::open(&device_choice(a.device.device.as_deref()), cache_folder().as_deref())?;
    let mut files = BTreeSet::from([PathBuf::from(&a.graph)]);
    loop {
        // As they look before the run: what is saved while it goes on starts the next one.
        let before: BTreeMap<PathBuf, Stamp> = files.iter().map(|file| (file.clone(), stamp(file))).collect();
        match once(&mut session, a) {
            Ok(report) => {
                output::say(&report.warnings);
                let what = if output::verbose() { describe(&report) } else { passes(&report) };
                output::say(&format!("{}: {:.0} ms, {what}", a.graph, report.wall.total));
            }
            Err(failure) => output::say(&failure.to_string()),
        }
        files.extend(session.files().iter().cloned());
        wait(&files.iter().map(|file| before.get(file).copied().unwrap_or_else(|| stamp(file))).collect::<Vec<_>>(), &files);
    }
}

fn once(session: &mut Session, a: &RunArgs) -> Result<Report, Failure> {
    let mut job = args::job(a)?;
    job.keep = true;
    let mut project = Project::open(&a.graph)?;
    let Some(document) = project.document.clone() else { return Err(project.failure(colour())) };
    bind(&mut job, &document, a)?;
    let (graph, world) = foresee(&mut project, &job, None)?;
    refuse_clashes(&job, a, graph.as_ref(), &world, None)?;
    session.run(&job)
}

/// Waits until one of the files looks different from before, and then until all rest: a file that is being written is
/// left alone.
fn wait(before: &[Stamp], files: &BTreeSet<PathBuf>) {
    let look = || files.iter().map(stamp).collect::<Vec<Stamp>>();
    let mut last = look();
    loop {
        std::thread::sleep(LOOK);
        let now = look();
        if now == last && now != before {
            return;
        }
        last = now;
    }
}

fn stamp(file: &PathBuf) -> Stamp {
    let about = std::fs::metadata(file).ok()?;
    Some((about.modified().ok()?, about.len()))
}
