//! `check` and `info`: what a graph says, and what is wrong with it. No GPU.

use std::fmt::Write as _;

use pipe::Failure;
use pipe::project::{Project, World};
use pipe_graph::document::{Document, ParameterType};
use pipe_graph::resolve::Request;
use pipe_graph::span::Syntax;
use serde_json::json;

use super::args::{CheckArgs, settings};
use super::{colour, output, print, print_json};

/// Every mistake.
pub(super) fn check(a: &CheckArgs) -> Result<(), Failure> {
    let mut project = Project::open(&a.graph)?;
    let request = Request { settings: settings(&a.set)?, frame: 1.0, ..Request::default() };
    project.resolve(&request, &World::default());
    let failed = project.diagnostics.has_errors();
    if a.json {
        print_json(&project.diagnostics.to_json(&project.sources))?;
        return if failed { Err(Failure::Differs) } else { Ok(()) };
    }
    if failed {
        return Err(project.failure(colour()));
    }
    output::say(&project.render(colour()));
    output::say(&format!("{}: no mistakes", a.graph));
    Ok(())
}

/// Inputs, outputs and parameters with ranges and docs.
pub(super) fn info(a: &CheckArgs) -> Result<(), Failure> {
    let mut project = Project::open(&a.graph)?;
    let Some(document) = project.document.clone() else { return Err(project.failure(colour())) };
    let request = Request { settings: settings(&a.set)?, frame: 1.0, ..Request::default() };
    let graph = project.resolve(&request, &World::default());
    if a.json {
        return print_json(&as_json(&document, graph.as_ref()));
    }
    let mut out = format!("{}\n", document.name);
    if !document.doc.is_empty() {
        let _ = writeln!(out, "  {}", document.doc);
    }
    let _ = writeln!(out, "\ninputs");
    for input in &document.inputs {
        let _ = writeln!(out, "  {:<16} {:<8} {}", input.name.value, input.kind.name(), input.doc);
    }
    let _ = writeln!(out, "\noutputs");
    for (name, edge) in &document.outputs {
        let ty = graph.as_ref().and_then(|g| g.outputs().find(|(n, _)| *n == name.value).map(|(_, v)| g.ty(v).kind().name()));
        let _ = writeln!(out, "  {:<16} {:<8} {}", name.value, ty.unwrap_or("?"), edge.value);
    }
    if !document.params.is_empty() {
        let _ = writeln!(out, "\nparameters");
    }
    for p in &document.params {
        let range = match (p.min, p.max) {
            (Some(a), Some(b)) => format!("{a} to {b}"),
            (Some(a), None) => format!("at least {a}"),
            (None, Some(b)) => format!("at most {b}"),
            (None, None) => String::new(),
        };
        let _ = writeln!(out, "  {:<16} {:<8} {:<10} {:<16} {}", p.name.value, type_name(p.ty), shown(&p.default.value), range, p.doc);
    }
    print(&out)
}

fn type_name(ty: ParameterType) -> &'static str {
    match ty {
        ParameterType::F32 => "F32",
        ParameterType::I32 => "I32",
        ParameterType::U32 => "U32",
        ParameterType::Bool => "Bool",
    }
}

fn shown(value: &Syntax) -> String {
    match value {
        Syntax::Bool(b) => b.to_string(),
        Syntax::Integer(v) => v.to_string(),
        Syntax::Float(v) => v.to_string(),
        Syntax::Text(t) => t.clone(),
        _ => String::new(),
    }
}

fn as_json(document: &Document, graph: Option<&pipe_graph::graph::Graph>) -> serde_json::Value {
    let inputs: Vec<_> = document.inputs.iter().map(|i| json!({"name": i.name.value, "type": i.kind.name(), "doc": i.doc})).collect();
    let kind = |name: &str| graph.and_then(|g| g.outputs().find(|(n, _)| *n == name).map(|(_, v)| g.ty(v).kind().name()));
    let outputs: Vec<_> = document.outputs.iter().map(|(n, e)| json!({"name": n.value, "type": kind(&n.value), "edge": e.value})).collect();
    let number = |value: &Syntax| match value {
        Syntax::Bool(b) => json!(b),
        Syntax::Integer(v) => json!(*v as i64),
        Syntax::Float(v) => json!(v),
        Syntax::Text(t) => json!(t),
        _ => serde_json::Value::Null,
    };
    let params: Vec<_> = document
        .params
        .iter()
        .map(|p| json!({"name": p.name.value, "type": type_name(p.ty), "default": number(&p.default.value), "min": p.min, "max": p.max, "doc": p.doc}))
        .collect();
    json!({"name": document.name, "doc": document.doc, "inputs": inputs, "outputs": outputs, "params": params})
}
