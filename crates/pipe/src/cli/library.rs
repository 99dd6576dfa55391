//! `nodes` and `presets`: what comes with the program.

use std::fmt::Write as _;

use pipe::project::Project;
use pipe::{Failure, presets};
use pipe_graph::diagnostic::nearest;
use pipe_nodes::reference;

use super::args::{NodesArgs, PresetsArgs};
use super::{print, print_json};

/// The node library, or one node.
pub(super) fn nodes(a: &NodesArgs) -> Result<(), Failure> {
    let registry = pipe_nodes::REGISTRY;
    let Some(name) = &a.name else {
        if a.json {
            return print_json(&reference::to_json(&registry));
        }
        return print(&if a.markdown { reference::page(&registry) } else { reference::list(&registry) });
    };
    let Some(kind) = registry.get(name) else {
        let hint =
            nearest(name, registry.iter().map(|k| k.name)).map_or("`pipe nodes` lists all".to_owned(), |n| format!("did you mean `{n}`?"));
        return Err(Failure::Graph(format!("there is no node `{name}`\n  next: {hint}")));
    };
    if a.json {
        return print_json(&serde_json::json!((kind.schema)()));
    }
    print(&reference::entry(kind))
}

/// The presets, or the text of one.
pub(super) fn presets(a: &PresetsArgs) -> Result<(), Failure> {
    if let Some(folder) = &a.gallery {
        return super::gallery::gallery(folder, a);
    }
    if let Some(name) = &a.name {
        let Some(text) = presets::text(name) else {
            let hint = nearest(name, presets::names()).map_or("`pipe presets` lists all".to_owned(), |n| format!("did you mean `{n}`?"));
            return Err(Failure::Graph(format!("there is no preset `{name}`\n  next: {hint}")));
        };
        return if a.json { print_json(&serde_json::json!({"name": name.trim_end_matches(".ron"), "text": text})) } else { print(text) };
    }
    let mut rows = Vec::new();
    for name in presets::names() {
        let doc = Project::open(name)?.document.map(|d| d.doc).unwrap_or_default();
        rows.push((name, doc));
    }
    if a.json {
        let list: Vec<_> = rows.iter().map(|(name, doc)| serde_json::json!({"name": name, "doc": doc})).collect();
        return print_json(&serde_json::json!(list));
    }
    let mut out = String::new();
    for (name, doc) in rows {
        let _ = writeln!(out, "{name:<20} {doc}");
    }
    print(&out)
}
