//! Step 1: the fields of every node are read, which tells the edges that it names.

use indexmap::IndexMap;

use super::scope::Frame;
use super::{Given, Resolver, field_of};
use crate::de::{EdgeUse, build_node, check_ranges, from_tree};
use crate::diagnostic::Diagnostic;
use crate::document::{Call, Field, Reader, with_nearest};
use crate::field::In;
use crate::graph::Options;
use crate::node::{Kind, Node};
use crate::span::{Span, Spanned, Syntax, Tree};
use crate::structure::{Feedback, Iterate, Subgraph};

/// A node whose fields are read and whose edges are not looked up yet.
pub(super) struct Draft {
    pub(super) call: Call,
    pub(super) kind: &'static Kind,
    pub(super) what: What,
    /// Edges in the order of the node's [`EdgeIndex`](crate::field::EdgeIndex).
    pub(super) edges: Vec<EdgeUse>,
    pub(super) options: Options,
}

/// What a draft will become.
pub(super) enum What {
    Node(Box<dyn Node>),
    Subgraph(Part),
    Iterate(Box<Body>),
    Feedback { next: Spanned<String>, delay: u32 },
}

/// A `Subgraph` as it was written.
pub(super) struct Part {
    pub(super) file: Spanned<String>,
    /// Names of inputs with the edge bound to each.
    pub(super) inputs: Vec<(String, usize)>,
    pub(super) params: Given,
}

/// The parts of an `Iterate` that are not plain fields.
pub(super) struct Body {
    pub(super) fields: Iterate,
    /// State names with the edge that each starts from.
    pub(super) states: Vec<(String, usize)>,
    pub(super) calls: Vec<Call>,
    pub(super) next: Vec<(Spanned<String>, Spanned<String>)>,
    /// Where the parts of `until` were written.
    pub(super) until: Option<Tree>,
}

/// The edge behind a port that was read for a map of ports.
fn edge_of<T>(ports: &IndexMap<String, In<T>>) -> Vec<(String, usize)> {
    ports.iter().map(|(name, port)| (name.clone(), port.edge.0 as usize)).collect()
}

fn take(fields: &mut Vec<Field>, name: &str) -> Option<Field> {
    fields.iter().position(|(key, _)| key.value == name).map(|i| fields.remove(i))
}

impl Resolver<'_> {
    /// Reads one call. When it cannot stand, the mistakes are noted, and it answers the edges that it names all the same.
    pub(super) fn draft(&mut self, call: &Call, frame: &Frame<'_>) -> Result<Draft, Vec<EdgeUse>> {
        let kind = self.registry.get(&call.kind.value).ok_or_else(Vec::new)?;
        let mut call = call.clone();
        self.apply_settings(&mut call, frame.prefix);
        let options = call.options.as_ref().map_or_else(Options::default, |tree| {
            let (options, _, mistakes) = from_tree::<Options>(tree, frame.env);
            self.diagnostics.extend(mistakes);
            self.refuse_options(&call, tree);
            options.unwrap_or_default()
        });
        let (what, edges) = match kind.name {
            "Subgraph" => self.draft_subgraph(&mut call, frame).ok_or_else(Vec::new)?,
            "Iterate" => self.draft_iterate(&mut call, frame).ok_or_else(Vec::new)?,
            "Feedback" => self.draft_feedback(&mut call, frame).ok_or_else(Vec::new)?,
            _ => {
                let built = build_node(kind, &call.fields, call.kind.span, frame.env);
                self.diagnostics.extend(built.diagnostics);
                match built.node {
                    Some(node) => (What::Node(node), built.edges),
                    None => return Err(built.edges),
                }
            }
        };
        Ok(Draft { call, kind, what, edges, options })
    }

    /// Options that would say nothing of a node which shapes the graph and makes no pixels itself.
    fn refuse_options(&mut self, call: &Call, options: &Tree) {
        let (refused, hint): (&[&str], &str) = match call.kind.value.as_str() {
            "Subgraph" | "Iterate" => (&["format", "border", "filter"], "the nodes inside have options of their own"),
            "Switch" => (&["format", "border", "filter"], "it passes an input on as it is; the nodes before it have options of their own"),
            "Feedback" => {
                (&["format", "border", "filter"], "it passes a value on as it is; the node that `next` names has options of its own")
            }
            _ => return,
        };
        let mut refuse = |name: &str, hint: &str| {
            if let Some((key, _)) = field_of(options, name) {
                let message = format!("`{}` cannot have `{name}`", call.name.value);
                self.diagnostics
                    .push(Diagnostic::error(key.span, message).label(format!("this means nothing to {}", call.kind.value)).hint(hint));
            }
        };
        refused.iter().for_each(|name| refuse(name, hint));
        match call.kind.value.as_str() {
            "Iterate" => refuse("repeat", "`count` says how often the body of an Iterate runs"),
            "Feedback" => refuse("repeat", "it passes one value on for each frame; Iterate passes values between iterations"),
            _ => {}
        }
    }

    fn draft_subgraph(&mut self, call: &mut Call, frame: &Frame<'_>) -> Option<(What, Vec<EdgeUse>)> {
        let mut params = Given::new();
        if let Some((_, tree)) = take(&mut call.fields, "params") {
            let mut reader = Reader { registry: self.registry, diagnostics: self.diagnostics };
            for (name, value) in reader.entries(&tree, "params") {
                // Tried here, so that mistakes are told even when the file cannot be read; only the file knows the type.
                let mistakes = match value.value {
                    Syntax::Bool(_) => Vec::new(),
                    _ => from_tree::<f64>(value, frame.env).2,
                };
                if mistakes.is_empty() {
                    params.insert(name.value, (name.span, value.clone()));
                }
                self.diagnostics.extend(mistakes);
            }
        }
        let file = call.fields.iter().find(|(key, _)| key.value == "file").map(|(_, tree)| tree.span);
        let (fields, edges, mistakes) = self.structure_fields::<Subgraph>(call, frame);
        self.diagnostics.extend(mistakes);
        let fields = fields?;
        let Some(span) = file else {
            self.diagnostics.push(Diagnostic::error(call.kind.span, "a Subgraph needs a file").label("expected `file: \"name.ron\"`"));
            return None;
        };
        let inputs = edge_of(&fields.inputs);
        Some((What::Subgraph(Part { file: Spanned { span, value: fields.file }, inputs, params }), edges))
    }

    fn draft_iterate(&mut self, call: &mut Call, frame: &Frame<'_>) -> Option<(What, Vec<EdgeUse>)> {
        let (body, next) = (take(&mut call.fields, "body"), take(&mut call.fields, "next"));
        let until = call.fields.iter().find(|(key, _)| key.value == "until").map(|(_, tree)| tree.clone());
        let (fields, edges, mistakes) = self.structure_fields::<Iterate>(call, frame);
        self.diagnostics.extend(mistakes);
        let mut missing = |what: &str, expected: &str| {
            self.diagnostics
                .push(Diagnostic::error(call.kind.span, format!("Iterate has no `{what}`")).label(format!("expected `{expected}`")));
        };
        if body.is_none() {
            missing("body", "body: {nodes…}");
        }
        if next.is_none() {
            missing("next", "next: {\"state\": \"node\"}");
        }
        let fields = fields?;
        if fields.state.is_empty() {
            missing("state", "state: {\"u\": \"seed\"}");
        }
        let mut ends = |place: Span, what: &str, label: &str| self.diagnostics.push(Diagnostic::error(place, what).label(label));
        match (&fields.count, &fields.until) {
            (Some(_), Some(_)) => ends(
                until.as_ref().map_or(call.kind.span, |t| t.span),
                "Iterate takes either `count` or `until`",
                "`count` is given already; remove one of them",
            ),
            (None, None) => ends(call.kind.span, "this Iterate never ends", "expected `count: 100` or `until: Below(…)`"),
            _ => {}
        }
        if fields.state.is_empty() {
            return None;
        }
        let (body, next) = (body?.1, next?.1);
        let mut reader = Reader { registry: self.registry, diagnostics: self.diagnostics };
        let calls = reader.calls(&body);
        let next = reader.outputs(&next);
        let states = edge_of(&fields.state);
        for (name, _) in &next {
            if !fields.state.contains_key(&name.value) {
                let d = Diagnostic::error(name.span, format!("`{}` is no state of this Iterate", name.value))
                    .label(format!("its states are {}", fields.state.keys().map(String::as_str).collect::<Vec<_>>().join(", ")));
                self.diagnostics.push(with_nearest(d, &name.value, fields.state.keys().map(String::as_str)));
            }
        }
        Some((What::Iterate(Box::new(Body { fields, states, calls, next, until })), edges))
    }

    fn draft_feedback(&mut self, call: &mut Call, frame: &Frame<'_>) -> Option<(What, Vec<EdgeUse>)> {
        let next = call.fields.iter().find(|(key, _)| key.value == "next").map(|(_, tree)| tree.span);
        let (fields, edges, mistakes) = self.structure_fields::<Feedback>(call, frame);
        self.diagnostics.extend(mistakes);
        let fields = fields?;
        if self.bodies > 0 {
            self.diagnostics.push(
                Diagnostic::error(call.kind.span, "Feedback cannot stand in an Iterate body")
                    .label("it passes values between frames")
                    .hint("a `state` passes values between iterations"),
            );
            return None;
        }
        let Some(next) = next else {
            self.diagnostics.push(Diagnostic::error(call.kind.span, "Feedback has no `next`").label("expected `next: \"node\"`"));
            return None;
        };
        if !fields.init.is_bound() {
            self.diagnostics.push(Diagnostic::error(call.kind.span, "missing input `init`").label("expected `init: \"NAME\"`"));
            return None;
        }
        Some((What::Feedback { next: Spanned { span: next, value: fields.next }, delay: fields.delay }, edges))
    }

    fn structure_fields<T: serde::de::DeserializeOwned + schemars::JsonSchema>(
        &self,
        call: &Call,
        frame: &Frame<'_>,
    ) -> (Option<T>, Vec<EdgeUse>, Vec<Diagnostic>) {
        let tree = Tree { span: call.kind.span, value: Syntax::Struct(Some(call.kind.clone()), call.fields.clone()) };
        let (fields, edges, mut mistakes) = from_tree::<T>(&tree, frame.env);
        check_ranges(&schemars::schema_for!(T), &call.fields, frame.env, &mut mistakes);
        (fields.filter(|_| mistakes.is_empty()), edges, mistakes)
    }
}
