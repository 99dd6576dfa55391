//! `Subgraph`: another file in place of a node, as it stands, run again and again, or bypassed.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use indexmap::IndexMap;

use super::draft::Part;
use super::scope::{Entity, Frame, Settling, body_graph};
use super::{Level, Resolver, field_of, normal};
use crate::de::{EdgeUse, build_node};
use crate::diagnostic::Diagnostic;
use crate::document::{Call, Document, with_nearest};
use crate::expr::Env;
use crate::graph::{Iteration, Options, Times, ValueRef, Work};
use crate::node::Output;
use crate::span::{Span, Spanned, Syntax, Tree};
use crate::types::EdgeType;

/// A subgraph whose file is read.
struct Opened<'a> {
    part: &'a Part,
    path: PathBuf,
    document: Arc<Document>,
}

type Ports = Vec<(String, ValueRef)>;

impl Resolver<'_> {
    pub(super) fn settle_subgraph(&mut self, site: Settling, part: &Part, frame: &Frame<'_>) -> Entity {
        let Some(opened) = self.open(part, frame) else { return Entity::Node(None) };
        if site.options.when == Some(false) {
            return self.bypass_subgraph(&site, &opened, frame);
        }
        if site.options.repeat.is_some_and(|times| times != 1) {
            return Entity::Node(self.repeat_subgraph(site, &opened, frame));
        }
        let ports = self.expand(&site, &site.inputs, &opened, frame);
        if let (Some(path), Some(ports)) = (&site.options.readback, &ports) {
            self.write_first(&site, path, ports, frame);
        }
        Entity::Node(ports)
    }

    /// Finds the file, unless it is one of those around.
    fn open<'a>(&mut self, part: &'a Part, frame: &Frame<'_>) -> Option<Opened<'a>> {
        let file = &part.file;
        let path = frame.folder.join(&file.value);
        if self.chain.contains(&normal(&path)) {
            let chain: Vec<_> = self.chain.iter().chain([&normal(&path)]).map(|p| p.display().to_string()).collect();
            self.diagnostics.push(
                Diagnostic::error(file.span, format!("a subgraph that contains itself: {}", chain.join(" -> ")))
                    .label("this closes the circle"),
            );
            return None;
        }
        let document = self.file(&path, file.span)?;
        Some(Opened { part, path, document })
    }

    /// Puts the nodes of the file into the current level, reading `inputs`; answers its ports.
    fn expand(&mut self, site: &Settling, inputs: &[ValueRef], opened: &Opened<'_>, frame: &Frame<'_>) -> Option<Ports> {
        let Opened { part: Part { file, inputs: bound, params }, path, document } = opened;
        let mut env = Env::new();
        for name in ["frame", "time"] {
            env.set(name, frame.env.get(name).unwrap_or_default());
        }
        let mut names = IndexMap::new();
        let mut fits = true;
        for input in &document.inputs {
            let name = &input.name.value;
            let Some((_, edge)) = bound.iter().find(|(n, _)| n == name) else {
                self.diagnostics.push(
                    Diagnostic::error(site.call.kind.span, format!("missing input `{name}` of {}", file.value))
                        .label(format!("expected `inputs: {{\"{name}\": \"NODE\"}}`")),
                );
                fits = false;
                continue;
            };
            let value = inputs[*edge];
            let use_ = EdgeUse { kinds: vec![input.kind], field: name.clone(), ..site.edges[*edge].clone() };
            fits &= self.check_kind(value, &use_);
            self.size_names(&mut env, name, self.ty(value));
            names.insert(name.clone(), Some(value));
        }
        for (name, edge) in bound {
            if !names.contains_key(name) && !document.inputs.iter().any(|i| i.name.value == *name) {
                let inputs = site.call.fields.iter().find(|(key, _)| key.value == "inputs");
                let span = inputs.and_then(|(_, tree)| key_span(tree, name)).unwrap_or(site.edges[*edge].span);
                let known = document.inputs.iter().map(|i| i.name.value.as_str());
                let d = Diagnostic::error(span, format!("{} has no input `{name}`", file.value)).label(list_of("inputs", known));
                self.diagnostics.push(with_nearest(d, name, document.inputs.iter().map(|i| i.name.value.as_str())));
                fits = false;
            }
        }
        for (name, (span, _)) in params {
            if !document.params.iter().any(|p| p.name.value == *name) {
                let known = document.params.iter().map(|p| p.name.value.as_str());
                let d = Diagnostic::error(*span, format!("{} has no parameter `{name}`", file.value)).label(list_of("parameters", known));
                self.diagnostics.push(with_nearest(d, name, document.params.iter().map(|p| p.name.value.as_str())));
            }
        }
        if !fits {
            return None;
        }
        let prefix = format!("{}{}/", frame.prefix, site.call.name.value);
        self.params(document, Some((params, frame.env)), &prefix, &mut env);
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        self.chain.push(normal(path));
        let inner = Frame { prefix: &prefix, env: &env, folder: &folder, outer: None };
        let scope = self.scope(&document.nodes, names, &inner);
        let mut ports = Vec::new();
        let mut complete = true;
        for (name, edge) in &document.outputs {
            match self.lookup(&scope, &inner, &edge.value, edge.span) {
                Some(value) => ports.push((name.value.clone(), value)),
                None => complete = false,
            }
        }
        self.chain.pop();
        complete.then_some(ports)
    }

    /// Does the same in a level of its own. One input may be a state of it, the others are captured.
    fn expand_apart(&mut self, site: &Settling, state: Option<usize>, opened: &Opened<'_>, frame: &Frame<'_>) -> Option<(Level, Ports)> {
        self.levels.push(Level::default());
        let level = self.levels.len() - 1;
        let outside: Vec<_> =
            site.inputs.iter().map(|value| (*value, self.levels[level - 1].dag[value.node].outputs[value.port].ty)).collect();
        let mut inside = Vec::with_capacity(outside.len());
        for (i, (value, ty)) in outside.into_iter().enumerate() {
            inside.push(if state == Some(i) {
                self.state(0, &site.edges[i].field, ty, site.edges[i].span)
            } else {
                self.capture(level, value)
            });
        }
        let ports = self.expand(site, &inside, opened, frame);
        let level = self.levels.pop().expect("pushed above");
        Some((level, ports?))
    }

    /// `when: false`: mistakes in the file are told all the same, but nothing of it stays.
    fn bypass_subgraph(&mut self, site: &Settling, opened: &Opened<'_>, frame: &Frame<'_>) -> Entity {
        let feedbacks = self.feedbacks.len();
        let expanded = self.expand_apart(site, None, opened, frame);
        self.feedbacks.truncate(feedbacks);
        let Some((level, ports)) = expanded else { return Entity::Node(None) };
        let outputs: Vec<_> = ports.into_iter().map(|(name, value)| Output::new(name, ty_in(&level, value))).collect();
        self.bypass(site, opened.first_input().map(|edge| &site.inputs[edge]), &outputs)
    }

    /// `repeat`: a loop whose body is the file and whose state goes from its first output to its first input. The other
    /// outputs stay inside.
    fn repeat_subgraph(&mut self, mut site: Settling, opened: &Opened<'_>, frame: &Frame<'_>) -> Option<Ports> {
        let first = opened.first_input();
        self.bodies += 1;
        let expanded = self.expand_apart(&site, first, opened, frame);
        self.bodies -= 1;
        let (level, ports) = expanded?;
        let types: Vec<_> = first.map(|edge| self.ty(site.inputs[edge])).into_iter().collect();
        let outputs: Vec<_> = ports.iter().take(1).map(|(name, value)| Output::new(name.clone(), ty_in(&level, *value))).collect();
        if !self.check_repeat(&site, &types, &outputs) {
            return None;
        }
        let times = Times::Fixed(site.options.repeat.take()?);
        let name = format!("{}{}/", frame.prefix, site.call.name.value);
        site.inputs = first.map(|edge| site.inputs[edge]).into_iter().chain(level.captures.into_keys()).collect();
        let outputs = outputs.into_iter().zip(types).map(|(output, ty)| Output { ty, ..output }).collect();
        let work = Work::Iterate(Box::new(Iteration { body: body_graph(name, level.dag), next: vec![ports[0].1], times }));
        Some(self.instance(site, work, outputs, frame))
    }

    /// `readback`: a Readback node of the first output, under the name that the option has with other nodes.
    fn write_first(&mut self, site: &Settling, path: &str, ports: &[(String, ValueRef)], frame: &Frame<'_>) {
        let (Some(kind), Some((_, first))) = (self.registry.get("Readback"), ports.first()) else { return };
        let options = site.call.options.as_ref();
        let place = options.and_then(|tree| field_of(tree, "readback")).map_or(site.call.kind.span, |(_, tree)| tree.span);
        let text = |text: &str| Tree { span: place, value: Syntax::Text(text.to_owned()) };
        let field = |name: &str, value: &str| (Spanned { span: place, value: name.to_owned() }, text(value));
        let fields = vec![field("source", &site.call.name.value), field("path", path)];
        let built = build_node(kind, &fields, place, frame.env);
        self.diagnostics.extend(built.diagnostics);
        let Some(node) = built.node else { return };
        let call = Call {
            name: Spanned { span: site.call.name.span, value: format!("{}:readback", site.call.name.value) },
            kind: Spanned { span: place, value: kind.name.to_owned() },
            fields,
            options: None,
            span: place,
        };
        let reading = Settling { call, kind: kind.name, edges: built.edges, options: Options::default(), inputs: vec![*first] };
        self.settle_node(reading, node, frame);
    }
}

impl Opened<'_> {
    /// The edge bound to the input that the file names first.
    fn first_input(&self) -> Option<usize> {
        let first = self.document.inputs.first()?;
        self.part.inputs.iter().find(|(name, _)| *name == first.name.value).map(|(_, edge)| *edge)
    }
}

fn ty_in(level: &Level, value: ValueRef) -> EdgeType {
    level.dag[value.node].outputs[value.port].ty
}

/// Where a map has this key.
fn key_span(tree: &Tree, name: &str) -> Option<Span> {
    let Syntax::Map(entries) = &tree.value else { return None };
    entries.iter().map(|(key, _)| key).find(|key| matches!(&key.value, Syntax::Text(text) if text == name)).map(|key| key.span)
}

/// `its inputs are a, b`
fn list_of<'n>(what: &str, names: impl Iterator<Item = &'n str>) -> String {
    let names: Vec<_> = names.collect();
    if names.is_empty() { format!("it has no {what}") } else { format!("its {what} are {}", names.join(", ")) }
}
