//! `plan`: what would run, without running it. No GPU.

use std::fmt::Write as _;

use pipe::Failure;
use pipe::project::{Project, World};
use pipe::run::{Job, first_size, make_plan};
use pipe_graph::pass::{Limits, Profile};
use pipe_graph::resolve::Request;
use pipe_plan::lower::{Rim, lower};
use serde_json::json;

use super::args::{self, PlanArgs};
use super::{colour, output, print, print_json};

/// Shows the plan.
pub(super) fn plan(a: &PlanArgs) -> Result<(), Failure> {
    let mut project = Project::open(&a.graph)?;
    let assumed = a.size.as_deref().map(args::size).transpose()?;
    let request = Request { assumed, settings: args::settings(&a.set)?, frame: 1.0, ..Request::default() };
    let Some(graph) = project.resolve(&request, &World::default()) else { return Err(project.failure(colour())) };
    output::say(&project.render(colour()));
    let mut limits = Limits::default();
    if a.cpu {
        limits.profile = Profile::Cpu;
    }
    let mut job = Job::new(&a.graph);
    job.fuse = !a.no_fuse;
    job.budget = a.vram.as_deref().map(args::bytes).transpose()?;
    for (name, _) in graph.outputs() {
        job.outputs.insert(name.to_owned(), String::new());
    }
    let rim = Rim::default();
    // What the last phase leaves is the plan.
    if let Some(phase) = a.after.as_deref().filter(|phase| *phase != "allocate") {
        let text = pipe_plan::after(lower(&graph, &rim, &limits)?, phase.parse().map_err(Failure::Graph)?, job.fuse, &limits);
        for (shown, flag) in [(a.dot, "--dot"), (a.svg, "--svg"), (a.wgsl, "--wgsl")] {
            if shown {
                return Err(Failure::Graph(format!(
                    "{flag} shows a whole plan, and there is none after {phase}\n  next: leave out {flag} or --after"
                )));
            }
        }
        return if a.json { print_json(&passes_json(&graph.name, phase, &text)) } else { print(&text) };
    }
    let plan = make_plan(&graph, &rim, &limits, &job)?;
    if a.wgsl {
        let mut out = String::new();
        for kernel in &plan.kernels {
            let _ = writeln!(out, "// {}\n{}", kernel.label, kernel.wgsl()?);
        }
        return print(&out);
    }
    if a.json {
        print_json(&plan.to_json(&first_size(&graph)))
    } else if a.dot {
        print(&plan.to_dot())
    } else if a.svg {
        print(&plan.to_svg())
    } else {
        print(&plan.to_text())
    }
}

/// `{graph, phase, passes}`, and what was decided about passes where the phase tells, one line each.
fn passes_json(graph: &str, phase: &str, text: &str) -> serde_json::Value {
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
    let (passes, decisions) = text.split_once("\n\n").unwrap_or((text, ""));
    let mut json = json!({"graph": graph, "phase": phase, "passes": lines(passes)});
    if !decisions.is_empty() {
        json["decisions"] = json!(lines(decisions));
    }
    json
}
