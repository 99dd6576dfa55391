//! `plan`: what would run, without running it. No GPU.

use std::fmt::Write as _;

use pipe::Failure;
use pipe::project::{Project, World};
use pipe::run::{Job, make_plan};
use pipe_graph::pass::{Limits, Profile};
use pipe_graph::resolve::Request;
use pipe_plan::lower::Rim;

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
    if let Some(phase) = &a.after {
        let passes = pipe_plan::lower::lower(&graph, &rim, &limits)?;
        let phase = phase.parse().map_err(Failure::Graph)?;
        return print(&pipe_plan::after(passes, phase, job.fuse, &limits));
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
        print_json(&plan.to_json())
    } else if a.dot {
        print(&plan.to_dot())
    } else if a.svg {
        print(&plan.to_svg())
    } else {
        print(&plan.to_text())
    }
}
