//! Which instances matter: those that an output, a readback or a feedback reaches.

use petgraph::graph::{DiGraph, NodeIndex};

use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::graph::{Instance, ValueRef, Wire, Work};
use crate::span::FileId;

/// Instances that act without being read: readbacks.
pub(super) fn sinks(dag: &DiGraph<Instance, Wire>) -> Vec<NodeIndex> {
    let acts = |i: &NodeIndex| {
        let instance = &dag[*i];
        instance.options.readback.is_some() || (matches!(instance.work, Work::Node(_)) && instance.outputs.is_empty())
    };
    dag.node_indices().filter(acts).collect()
}

/// Warns of every node of the main file whose result goes nowhere.
pub(super) fn warn_unused(
    dag: &DiGraph<Instance, Wire>,
    outputs: impl Iterator<Item = ValueRef>,
    file: FileId,
    diagnostics: &mut Diagnostics,
) {
    let mut used = vec![false; dag.node_count()];
    let mut open: Vec<NodeIndex> = outputs.map(|v| v.node).chain(sinks(dag)).collect();
    while let Some(node) = open.pop() {
        if std::mem::replace(&mut used[node.index()], true) {
            continue;
        }
        let instance = &dag[node];
        open.extend(instance.inputs.iter().map(|v| v.node));
        if let Work::Feedback { next, .. } = instance.work {
            open.push(next.node);
        }
    }
    for node in dag.node_indices() {
        let instance = &dag[node];
        let written = matches!(instance.work, Work::Node(_) | Work::Iterate(_) | Work::Feedback { .. });
        if written && !used[node.index()] && instance.span.file == file {
            diagnostics.push(
                Diagnostic::warning(instance.span, format!("`{}` is not used", instance.name))
                    .label("its result goes nowhere")
                    .hint("remove it, or name it in `outputs`"),
            );
        }
    }
}
