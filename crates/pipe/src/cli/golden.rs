//! `test`: the golden tests of a folder.
//!
//! A test is a folder with `graph.ron` (or the name of a preset in `test.json`), its inputs, and what is expected:
//!
//! ```json
//! {"graph": "graph.ron", "inputs": {"in": "in.exr"}, "outputs": {"out": "expected.exr"},
//!  "settings": {"key": "0.2"}, "tolerance": 1e-4, "percent": 0.1}
//! ```
//!
//! Without a `test.json`, `graph.ron`, `in.exr` or `in.png`, and `expected.exr` or `expected.png` are meant.

use std::path::{Path, PathBuf};

use indexmap::IndexMap;
use pipe::Failure;
use pipe::compare::compare_files;
use pipe::run::{Job, Session};
use serde::Deserialize;

use super::args::TestArgs;
use super::{cache_folder, device_choice, output, print, print_json};

/// One test.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Golden {
    #[serde(default = "graph_file")]
    graph: String,
    #[serde(default)]
    inputs: IndexMap<String, String>,
    outputs: IndexMap<String, String>,
    #[serde(default)]
    settings: IndexMap<String, String>,
    #[serde(default = "tolerance")]
    tolerance: f64,
    #[serde(default)]
    percent: f64,
}

fn graph_file() -> String {
    "graph.ron".into()
}

const fn tolerance() -> f64 {
    1e-4
}

/// Runs every test below a folder.
pub(super) fn test(a: &TestArgs) -> Result<(), Failure> {
    let mut folders = Vec::new();
    find(&a.folder, &mut folders).map_err(|e| Failure::World(format!("cannot read {}: {e}", a.folder.display())))?;
    folders.sort();
    if folders.is_empty() {
        return Err(Failure::World(format!(
            "{} holds no test\n  next: a test is a folder with graph.ron or test.json",
            a.folder.display()
        )));
    }
    let mut session = Session::open(&device_choice(a.device.device.as_deref()), cache_folder().as_deref())?;
    let (mut passed, mut failed, mut rows) = (0, 0, Vec::new());
    for folder in folders {
        let name = folder.strip_prefix(&a.folder).unwrap_or(&folder).display().to_string();
        let result = one(&mut session, &folder, a);
        rows.push(serde_json::json!({"test": name, "passed": result.is_ok(), "reason": result.as_ref().err()}));
        match result {
            Ok(()) => passed += 1,
            Err(reason) => {
                failed += 1;
                output::say(&format!("{name}: {reason}"));
            }
        }
    }
    if a.json {
        print_json(&serde_json::json!(rows))?;
    } else {
        print(&format!("{passed} passed, {failed} failed\n"))?;
    }
    if failed == 0 { Ok(()) } else { Err(Failure::Differs) }
}

fn find(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if folder.join("graph.ron").is_file() || folder.join("test.json").is_file() {
        found.push(folder.to_owned());
        return Ok(());
    }
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            find(&path, found)?;
        }
    }
    Ok(())
}

fn read(folder: &Path) -> Result<Golden, String> {
    match std::fs::read_to_string(folder.join("test.json")) {
        Ok(text) => serde_json::from_str(&text).map_err(|e| format!("test.json: {e}")),
        Err(_) => {
            let pick = |stem: &str| ["exr", "png"].iter().map(|e| format!("{stem}.{e}")).find(|f| folder.join(f).is_file());
            let outputs = pick("expected").ok_or("there is no test.json and no expected.exr or expected.png")?;
            Ok(Golden {
                graph: graph_file(),
                inputs: pick("in").map(|f| ("in".to_owned(), f)).into_iter().collect(),
                outputs: IndexMap::from([("out".to_owned(), outputs)]),
                settings: IndexMap::new(),
                tolerance: tolerance(),
                percent: 0.0,
            })
        }
    }
}

fn one(session: &mut Session, folder: &Path, a: &TestArgs) -> Result<(), String> {
    let golden = read(folder)?;
    let own = folder.join(&golden.graph);
    let mut job = Job::new(&if own.is_file() { own.display().to_string() } else { golden.graph.clone() });
    job.fuse = !a.device.no_fuse;
    job.settings = golden.settings.clone().into_iter().collect();
    for (name, file) in &golden.inputs {
        job.bind_input(name, &folder.join(file).display().to_string());
    }
    let made = tempfile::tempdir().map_err(|e| e.to_string())?;
    for (name, file) in &golden.outputs {
        let target = if a.bless { folder.join(file) } else { made.path().join(file) };
        job.bind_output(name, &target.display().to_string()).map_err(|e| e.to_string())?;
    }
    session.run(&job).map_err(|e| e.to_string())?;
    if a.bless {
        return Ok(());
    }
    for (name, file) in &golden.outputs {
        let (got, expected) = (made.path().join(file), folder.join(file));
        let c = compare_files(&got.display().to_string(), &expected.display().to_string(), golden.tolerance).map_err(|e| e.to_string())?;
        if c.different_percent > golden.percent {
            let node = first_difference(session, &job, &golden);
            return Err(format!(
                "output `{name}` differs: {:.3} % of pixels by more than {:e}, at most {:e} at ({}, {}){node}\n  next: look at it; when it is right, `pipe test --bless {}` takes it over",
                c.different_percent,
                golden.tolerance,
                c.max_abs,
                c.worst.x,
                c.worst.y,
                folder.display()
            ));
        }
    }
    Ok(())
}

/// The first node whose fused and unfused values differ, if there is one: then the planner is at fault, not a node.
fn first_difference(session: &mut Session, job: &Job, golden: &Golden) -> String {
    let mut run = || -> Option<String> {
        let made = tempfile::tempdir().ok()?;
        let project = pipe::project::Project::open(&job.graph).ok()?;
        for call in &project.document.as_ref()?.nodes {
            let name = &call.name.value;
            let mut files = Vec::new();
            for fuse in [true, false] {
                let file = made.path().join(format!("{name}-{fuse}.exr")).display().to_string();
                let mut dump = Job { fuse, ..job.clone() };
                dump.outputs.clear();
                dump.dumps.insert(name.clone(), file.clone());
                if session.run(&dump).is_err() {
                    break;
                }
                files.push(file);
            }
            if let [a, b] = files.as_slice()
                && compare_files(a, b, golden.tolerance).is_ok_and(|c| c.different_percent > golden.percent)
            {
                return Some(format!("; fused and unfused differ first at node `{name}`"));
            }
        }
        project.document?.outputs.first().map(|(_, edge)| format!("; it is the value of node `{}`", edge.value))
    };
    run().unwrap_or_default()
}
