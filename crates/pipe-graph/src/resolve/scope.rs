//! Steps 2 and 3: names are looked up, cycles found, types computed and instances made.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::path::Path;
use std::sync::Arc;

use indexmap::IndexMap;
use petgraph::algo::tarjan_scc;
use petgraph::graph::{DiGraph, NodeIndex};

use super::draft::{Body, Draft, What};
use super::{Level, MOST_NODES, Resolver, article, field_of};
use crate::de::EdgeUse;
use crate::diagnostic::Diagnostic;
use crate::document::{Call, with_nearest};
use crate::expr::Env;
use crate::graph::{Format, Graph, Instance, Iteration, Options, Times, ValueRef, Wire, Work};
use crate::node::{Category, Inputs, Kind, Mistake, Node, Opening, Output};
use crate::span::{Span, Syntax, Tree};
use crate::structure::Until;
use crate::types::{EdgeKind, EdgeType, Precision};

/// Where a scope stands.
pub(super) struct Frame<'a> {
    /// Put before the name of every instance: `glow/`.
    pub(super) prefix: &'a str,
    /// What expressions may name.
    pub(super) env: &'a Env,
    /// Paths are relative to it.
    pub(super) folder: &'a Path,
    /// The scope around an `Iterate` body, whose names the body may use.
    pub(super) outer: Option<(&'a Scope, &'a Frame<'a>)>,
}

/// What a name stands for. `None` is something that is already known to be wrong.
#[derive(Clone)]
pub(super) enum Entity {
    Value(Option<ValueRef>),
    Node(Option<Vec<(String, ValueRef)>>),
}

/// The names of a scope.
#[derive(Default)]
pub(super) struct Scope {
    entities: IndexMap<String, Entity>,
    /// Names of all nodes, of those too that are not settled yet.
    calls: Vec<String>,
    /// What they are, as far as that is known.
    kinds: IndexMap<String, &'static Kind>,
}

impl Scope {
    /// Every name that can be meant.
    fn names(&self) -> impl Iterator<Item = &str> {
        self.entities.keys().chain(&self.calls).map(String::as_str)
    }

    /// The ports of a node in which there is some mistake: those of its kind, where all nodes of the kind have the same.
    fn ports_of_kind(&self, name: &str) -> Option<Vec<&'static str>> {
        let kind = self.kinds.get(name).filter(|kind| kind.category != Category::Structure)?;
        Some(kind.ports.iter().map(|(port, _)| *port).collect())
    }
}

impl Resolver<'_> {
    /// Resolves one `nodes` map. `names` are the values that are there before: graph inputs, states.
    pub(super) fn scope(&mut self, calls: &[Call], names: IndexMap<String, Option<ValueRef>>, frame: &Frame<'_>) -> Scope {
        let mut scope = Scope::default();
        for (name, value) in names {
            scope.entities.insert(name, Entity::Value(value));
        }
        let mut calls: Vec<&Call> = calls.iter().collect();
        calls.sort_by(|a, b| a.name.value.cmp(&b.name.value));
        scope.calls = calls.iter().map(|c| c.name.value.clone()).collect();
        let named = |call: &&Call| Some((call.name.value.clone(), self.registry.get(&call.kind.value)?));
        scope.kinds = calls.iter().filter_map(named).collect();
        let mut drafts = Vec::new();
        // What nodes name in which there is some other mistake.
        let mut others = Vec::new();
        for call in calls {
            match self.draft(call, frame) {
                Ok(draft) => drafts.push(draft),
                Err(edges) => {
                    scope.entities.insert(call.name.value.clone(), Entity::Node(None));
                    others.extend(edges);
                }
            }
        }
        let order = self.link(&drafts, &mut scope);
        let mut drafts: Vec<Option<Draft>> = drafts.into_iter().map(Some).collect();
        let mut delayed = Vec::new();
        for index in order {
            let draft = drafts[index].take().expect("an order names each draft once");
            let name = draft.call.name.value.clone();
            if let What::Feedback { next, .. } = &draft.what {
                delayed.push((name.clone(), next.clone(), draft.options.when == Some(false)));
            }
            let entity = if self.count_nodes() > MOST_NODES {
                self.diagnostics.push(Diagnostic::error(
                    draft.call.span,
                    format!("the graph has more than {MOST_NODES} nodes once its subgraphs are in place"),
                ));
                Entity::Node(None)
            } else {
                self.settle(draft, &scope, frame)
            };
            scope.entities.insert(name, entity);
        }
        for edge in others {
            self.lookup(&scope, frame, &edge.text, edge.span);
        }
        for (name, next, bypassed) in delayed {
            let Some(Entity::Node(Some(ports))) = scope.entities.get(&name) else { continue };
            let at = ports[0].1;
            // What a bypassed one names must be there all the same.
            if let Some(value) = self.lookup(&scope, frame, &next.value, next.span)
                && !bypassed
            {
                if let Work::Feedback { next, .. } = &mut self.level().dag[at.node].work {
                    *next = value;
                }
                self.feedbacks.push((at, next.span));
            }
        }
        scope
    }

    /// A dependency order of the drafts; those on a cycle are reported and left out.
    fn link(&mut self, drafts: &[Draft], scope: &mut Scope) -> Vec<usize> {
        let position: IndexMap<&str, usize> = drafts.iter().enumerate().map(|(i, d)| (d.call.name.value.as_str(), i)).collect();
        let mut dag = DiGraph::<(), Span>::new();
        let nodes: Vec<NodeIndex> = drafts.iter().map(|_| dag.add_node(())).collect();
        for (i, draft) in drafts.iter().enumerate() {
            let mut texts: Vec<(&str, Span)> = draft.edges.iter().map(|e| (e.text.as_str(), e.span)).collect();
            if let What::Iterate(body) = &draft.what {
                captured_texts(body, &mut texts);
            }
            for (text, span) in texts {
                let head = text.split('.').next().unwrap_or_default();
                if let Some(from) = position.get(head) {
                    dag.add_edge(nodes[*from], nodes[i], span);
                }
            }
        }
        let mut waits: Vec<usize> = nodes.iter().map(|n| dag.edges_directed(*n, petgraph::Incoming).count()).collect();
        let mut ready: BinaryHeap<Reverse<usize>> = (0..drafts.len()).filter(|i| waits[*i] == 0).map(Reverse).collect();
        let mut order = Vec::with_capacity(drafts.len());
        while let Some(Reverse(i)) = ready.pop() {
            order.push(i);
            for to in dag.neighbors(nodes[i]) {
                waits[to.index()] -= 1;
                if waits[to.index()] == 0 {
                    ready.push(Reverse(to.index()));
                }
            }
        }
        if order.len() < drafts.len() {
            for component in tarjan_scc(&dag) {
                self.report_cycle(&dag, &component, drafts);
            }
            for (i, draft) in drafts.iter().enumerate() {
                if waits[i] > 0 {
                    scope.entities.insert(draft.call.name.value.clone(), Entity::Node(None));
                }
            }
        }
        order
    }

    fn report_cycle(&mut self, dag: &DiGraph<(), Span>, component: &[NodeIndex], drafts: &[Draft]) {
        let first = *component.iter().min().expect("components are not empty");
        let name = |n: NodeIndex| drafts[n.index()].call.name.value.as_str();
        // The shortest way from the first node back to itself, inside the component.
        let mut came: IndexMap<NodeIndex, NodeIndex> = IndexMap::new();
        let mut open = std::collections::VecDeque::from([first]);
        while let Some(at) = open.pop_front() {
            let mut next: Vec<_> = dag.neighbors(at).filter(|n| component.contains(n)).collect();
            next.sort_unstable();
            for to in next {
                if to == first {
                    let mut path = vec![at];
                    while let Some(before) = came.get(path.last().expect("begins with one")) {
                        path.push(*before);
                    }
                    path.reverse();
                    let shown: Vec<_> = path.iter().chain([&first]).map(|n| name(*n)).collect();
                    let edge = dag.find_edge(at, first).expect("just walked");
                    self.diagnostics.push(
                        Diagnostic::error(dag[edge], format!("a cycle: {}", shown.join(" -> ")))
                            .label("this edge closes it")
                            .hint("Feedback passes a value to the next frame, Iterate to the next iteration"),
                    );
                    return;
                }
                if to != first && !came.contains_key(&to) {
                    came.insert(to, at);
                    open.push_back(to);
                }
            }
        }
    }

    /// The value that an edge names, or `None` with the mistake noted (once).
    pub(super) fn lookup(&mut self, scope: &Scope, frame: &Frame<'_>, text: &str, span: Span) -> Option<ValueRef> {
        let (name, port) = match text.split_once('.') {
            Some((name, port)) => (name, Some(port)),
            None => (text, None),
        };
        let level = self.levels.len() - 1;
        match self.find(level, scope, frame, name) {
            Some(Entity::Value(value)) => {
                if let Some(port) = port {
                    self.diagnostics
                        .push(Diagnostic::error(span, format!("`{name}` has no ports")).label(format!("expected `{name}`, not `.{port}`")));
                    return None;
                }
                value
            }
            Some(Entity::Node(None)) => {
                if let (Some(port), Some(names)) = (port, scope.ports_of_kind(name))
                    && !names.contains(&port)
                {
                    self.no_port(span, name, port, names);
                }
                None
            }
            Some(Entity::Node(Some(ports))) => {
                let found = match port {
                    None => ports.first(),
                    Some(port) => ports.iter().find(|(n, _)| n == port),
                };
                if let Some((_, value)) = found {
                    return Some(*value);
                }
                match port {
                    Some(port) => self.no_port(span, name, port, ports.iter().map(|(n, _)| n.as_str()).collect()),
                    None => {
                        let d = Diagnostic::error(span, format!("`{name}` has no outputs")).label("nothing can be read from it");
                        self.diagnostics.push(d);
                    }
                }
                None
            }
            None => {
                let mut names: Vec<&str> = scope.names().collect();
                let mut outer = frame.outer;
                while let Some((scope, frame)) = outer {
                    names.extend(scope.names());
                    outer = frame.outer;
                }
                // A node whose name cannot be one is told where it is defined.
                if names.contains(&text) {
                    return None;
                }
                let d = Diagnostic::error(span, format!("there is no node or input `{name}`")).label("unknown name");
                self.diagnostics.push(with_nearest(d, name, names));
                None
            }
        }
    }

    fn no_port(&mut self, span: Span, name: &str, port: &str, names: Vec<&str>) {
        let label = if names.is_empty() { "it has none".to_owned() } else { format!("its ports are {}", names.join(", ")) };
        let d = Diagnostic::error(span, format!("`{name}` has no port `{port}`")).label(label);
        self.diagnostics.push(with_nearest(d, port, names));
    }

    /// What a name stands for, seen from a level; a value of an outer scope is captured on its way in.
    fn find(&mut self, level: usize, scope: &Scope, frame: &Frame<'_>, name: &str) -> Option<Entity> {
        if let Some(entity) = scope.entities.get(name) {
            return Some(entity.clone());
        }
        let (outer, around) = frame.outer?;
        Some(match self.find(level - 1, outer, around, name)? {
            Entity::Value(value) => Entity::Value(value.map(|v| self.capture(level, v))),
            Entity::Node(ports) => Entity::Node(ports.map(|ports| ports.into_iter().map(|(n, v)| (n, self.capture(level, v))).collect())),
        })
    }

    pub(super) fn capture(&mut self, level: usize, outside: ValueRef) -> ValueRef {
        if let Some(known) = self.levels[level].captures.get(&outside) {
            return *known;
        }
        let from = &self.levels[level - 1].dag[outside.node];
        let (ty, name, span) = (from.outputs[outside.port].ty, from.name.clone(), from.span);
        let level = &mut self.levels[level];
        let node = level.dag.add_node(Instance {
            name,
            kind: "Capture",
            span,
            work: Work::Capture(level.captures.len()),
            inputs: Vec::new(),
            outputs: Output::out(ty),
            options: Options::default(),
        });
        let inside = ValueRef { node, port: 0 };
        level.captures.insert(outside, inside);
        inside
    }

    fn settle(&mut self, draft: Draft, scope: &Scope, frame: &Frame<'_>) -> Entity {
        let mut inputs = Vec::with_capacity(draft.edges.len());
        for edge in &draft.edges {
            inputs.push(self.lookup(scope, frame, &edge.text, edge.span).filter(|v| self.check_kind(*v, edge)));
        }
        let Some(inputs) = inputs.into_iter().collect::<Option<Vec<_>>>() else { return Entity::Node(None) };
        let Draft { call, kind, what, edges, options } = draft;
        let site = Settling { call, kind: kind.name, edges, options, inputs };
        match what {
            What::Node(node) => self.settle_node(site, node, frame),
            What::Subgraph(part) => self.settle_subgraph(site, &part, frame),
            What::Iterate(body) => Entity::Node(self.settle_iterate(site, &body, scope, frame)),
            What::Feedback { delay, .. } => {
                let outputs = Output::out(self.ty(site.inputs[0]));
                if site.options.when == Some(false) {
                    return self.bypass(&site, site.inputs.first(), &outputs);
                }
                // `next` points at the node itself until the scope is complete.
                let own = ValueRef { node: NodeIndex::new(self.level().dag.node_count()), port: 0 };
                Entity::Node(Some(self.instance(site, Work::Feedback { next: own, delay }, outputs, frame)))
            }
        }
    }

    pub(super) fn check_kind(&mut self, value: ValueRef, edge: &EdgeUse) -> bool {
        let ty = self.ty(value);
        if edge.kinds.contains(&ty.kind()) {
            return true;
        }
        let wanted: Vec<_> = edge.kinds.iter().map(|k| article(*k)).collect();
        let mut d = Diagnostic::error(
            edge.span,
            format!("`{}` is {}, but `{}` takes {}", edge.text, article(ty.kind()), edge.field, wanted.join(" or ")),
        )
        .label(format!("expected {}", wanted.join(" or ")));
        if edge.kinds == [EdgeKind::Scalar] {
            d = d.hint("PyramidAverage and Stats make scalars of an image");
        }
        self.diagnostics.push(d);
        false
    }

    pub(super) fn settle_node(&mut self, site: Settling, mut node: Box<dyn Node>, frame: &Frame<'_>) -> Entity {
        if let Err(mistake) = node.open(&Opening { loader: self.loader, folder: frame.folder }) {
            self.note(&site, mistake, false);
            return Entity::Node(None);
        }
        let types: Vec<EdgeType> = site.inputs.iter().map(|v| self.ty(*v)).collect();
        let mut warnings = Vec::new();
        let outputs = node.outputs(&mut Inputs { types: &types, warnings: &mut warnings });
        for warning in warnings {
            self.note(&site, warning, true);
        }
        let mut outputs = match outputs {
            Ok(outputs) => outputs,
            Err(mistake) => {
                self.note(&site, mistake, false);
                return Entity::Node(None);
            }
        };
        for output in &mut outputs {
            match (&mut output.ty, site.options.format) {
                (EdgeType::Image(t), Format::F16) => t.precision = Precision::F16,
                (EdgeType::Volume(t), Format::F16) => t.precision = Precision::F16,
                (EdgeType::Image(t), Format::F32) => t.precision = Precision::F32,
                (EdgeType::Volume(t), Format::F32) => t.precision = Precision::F32,
                _ => {}
            }
            if let Some(mistake) = impossible(output) {
                self.note(&site, mistake, false);
                return Entity::Node(None);
            }
        }
        if site.options.when == Some(false) {
            return self.bypass(&site, site.inputs.first(), &outputs);
        }
        if !self.check_repeat(&site, &types, &outputs) {
            return Entity::Node(None);
        }
        Entity::Node(Some(self.instance(site, Work::Node(Arc::from(node)), outputs, frame)))
    }

    /// `when: false`: the first input passes through, to every port that is an edge of its type.
    pub(super) fn bypass(&mut self, site: &Settling, first: Option<&ValueRef>, outputs: &[Output]) -> Entity {
        let (Some(first), Some(out)) = (first, outputs.first()) else {
            if outputs.is_empty() {
                return Entity::Node(Some(Vec::new()));
            }
            self.note(site, Mistake::in_field("options.when", "cannot be bypassed: it has no input that could pass through"), false);
            return Entity::Node(None);
        };
        let ty = self.ty(*first);
        if ty.kind() != out.ty.kind() {
            let (got, want) = (article(ty.kind()), article(out.ty.kind()));
            self.note(site, Mistake::in_field("options.when", format!("cannot be bypassed: its input is {got}, its output {want}")), false);
            return Entity::Node(None);
        }
        let alike = outputs.iter().filter(|out| out.ty.kind() == ty.kind());
        Entity::Node(Some(alike.map(|out| (out.name.clone(), *first)).collect()))
    }

    pub(super) fn check_repeat(&mut self, site: &Settling, types: &[EdgeType], outputs: &[Output]) -> bool {
        let mistake = match (site.options.repeat, types.first(), outputs.first()) {
            (None | Some(1), ..) => return true,
            (Some(0), ..) => {
                let mistake =
                    Mistake::in_field("options.repeat", "runs 0 times; expected at least 1").hint("`when: false` bypasses a node");
                self.note(site, mistake, false);
                return false;
            }
            (Some(_), Some(input), Some(output)) => {
                if same_shape(input, &output.ty) {
                    return true;
                }
                format!("cannot repeat: its first input is {input}, its output is {}", output.ty)
            }
            (Some(_), ..) => "cannot repeat: it has no input that its output could go to".to_owned(),
        };
        self.note(site, Mistake::in_field("options.repeat", mistake), false);
        false
    }

    fn settle_iterate(&mut self, site: Settling, parts: &Body, scope: &Scope, frame: &Frame<'_>) -> Option<Vec<(String, ValueRef)>> {
        let types: Vec<EdgeType> = site.inputs.iter().map(|v| self.ty(*v)).collect();
        self.levels.push(Level::default());
        self.bodies += 1;
        let mut env = frame.env.clone();
        let mut names = IndexMap::new();
        for (position, (name, edge)) in parts.states.iter().enumerate() {
            self.size_names(&mut env, name, types[*edge]);
            names.insert(name.clone(), Some(self.state(position, name, types[*edge], site.edges[*edge].span)));
        }
        let prefix = format!("{}{}/", frame.prefix, site.call.name.value);
        let inner = Frame { prefix: &prefix, env: &env, folder: frame.folder, outer: Some((scope, frame)) };
        let body = self.scope(&parts.calls, names, &inner);
        let mut next = Vec::new();
        for (name, edge) in &parts.states {
            let Some((_, text)) = parts.next.iter().find(|(n, _)| n.value == *name) else {
                self.diagnostics.push(
                    Diagnostic::error(site.call.kind.span, format!("state `{name}` has no `next`"))
                        .label(format!("expected `next: {{\"{name}\": \"NODE\"}}`")),
                );
                continue;
            };
            let Some(value) = self.lookup(&body, &inner, &text.value, text.span) else { continue };
            let (was, becomes) = (types[*edge], self.ty(value));
            if same_shape(&was, &becomes) {
                next.push(value);
            } else {
                self.diagnostics.push(
                    Diagnostic::error(text.span, format!("state `{name}` is {was}, but its next value is {becomes}"))
                        .label("expected a value of the same type and size"),
                );
            }
        }
        let times = self.times(parts, &site, &body, &inner);
        self.bodies -= 1;
        let level = self.levels.pop().expect("pushed above");
        if next.len() < parts.states.len() {
            return None;
        }
        let work = Work::Iterate(Box::new(Iteration { body: body_graph(prefix, level.dag), next, times: times? }));
        // Bypassed, it is a loop that never runs: every state leaves as it came.
        if site.options.when == Some(false) {
            return Some(parts.states.iter().map(|(name, edge)| (name.clone(), site.inputs[*edge])).collect());
        }
        let outputs = parts.states.iter().map(|(name, edge)| Output::new(name.clone(), types[*edge])).collect();
        let mut site = site;
        site.inputs = parts.states.iter().map(|(_, edge)| site.inputs[*edge]).chain(level.captures.into_keys()).collect();
        Some(self.instance(site, work, outputs, frame))
    }

    /// In a body: the value that changes from one iteration to the next.
    pub(super) fn state(&mut self, position: usize, name: &str, ty: EdgeType, span: Span) -> ValueRef {
        let node = self.level().dag.add_node(Instance {
            name: name.to_owned(),
            kind: "State",
            span,
            work: Work::State(position),
            inputs: Vec::new(),
            outputs: Output::out(ty),
            options: Options::default(),
        });
        ValueRef { node, port: 0 }
    }

    fn times(&mut self, parts: &Body, site: &Settling, body: &Scope, inner: &Frame<'_>) -> Option<Times> {
        let Some(Until::Below { value, limit, every }) = &parts.fields.until else {
            return parts.fields.count.map(Times::Fixed);
        };
        let place = |name: &str| {
            let until = parts.until.as_ref();
            until.map_or(site.call.kind.span, |tree| field_of(tree, name).map_or(tree.span, |(_, value)| value.span))
        };
        let span = place("value");
        if *every == 0 {
            self.diagnostics.push(Diagnostic::error(place("every"), "`every` is 0").label("expected at least 1"));
            return None;
        }
        let found = self.lookup(body, inner, value, span)?;
        let use_ = EdgeUse { field: "until".to_owned(), kinds: vec![EdgeKind::Scalar], text: value.clone(), span };
        if !self.check_kind(found, &use_) {
            return None;
        }
        Some(Times::Until { value: found, limit: *limit, every: *every, max: parts.fields.max })
    }

    /// Makes the instance and its wires; answers its ports.
    pub(super) fn instance(&mut self, site: Settling, work: Work, outputs: Vec<Output>, frame: &Frame<'_>) -> Vec<(String, ValueRef)> {
        let dag = &mut self.level().dag;
        let names: Vec<String> = outputs.iter().map(|o| o.name.clone()).collect();
        let inputs = site.inputs.clone();
        let node = dag.add_node(Instance {
            name: format!("{}{}", frame.prefix, site.call.name.value),
            kind: site.kind,
            span: site.call.name.span,
            work,
            inputs: site.inputs,
            outputs,
            options: site.options,
        });
        for (input, value) in inputs.iter().enumerate() {
            dag.add_edge(value.node, node, Wire { port: value.port, input });
        }
        names.into_iter().enumerate().map(|(port, name)| (name, ValueRef { node, port })).collect()
    }

    /// A node's own mistake, at the place of its field.
    fn note(&mut self, site: &Settling, mistake: Mistake, warning: bool) {
        let field = mistake.field.as_deref().unwrap_or_default();
        let head = field.split('.').next().unwrap_or_default();
        let span = if head == "options" {
            let options = site.call.options.as_ref();
            let part = |tree| field_of(tree, field.trim_start_matches("options.")).map(|(_, value)| value.span);
            options.map(|tree| part(tree).unwrap_or(tree.span))
        } else {
            let edge = site.edges.iter().find(|e| e.field == field).map(|e| e.span);
            edge.or_else(|| site.call.fields.iter().find(|(key, _)| key.value == head).map(|(_, tree)| tree.span))
        };
        let span = span.unwrap_or(site.call.kind.span);
        let message = if mistake.field.is_some() && head != "options" {
            // Some say the field's name themselves.
            let rest = mistake.message.strip_prefix(field).filter(|rest| rest.starts_with(' '));
            format!("`{field}` {}", rest.map_or(mistake.message.as_str(), str::trim_start))
        } else {
            format!("`{}` {}", site.call.name.value, mistake.message)
        };
        let mut d = if warning { Diagnostic::warning(span, message) } else { Diagnostic::error(span, message) };
        if let Some(hint) = mistake.hint {
            d = d.hint(hint);
        }
        self.diagnostics.push(d);
    }

    pub(super) fn ty(&self, value: ValueRef) -> EdgeType {
        let level = self.levels.last().expect("there is always the file's own level");
        level.dag[value.node].outputs[value.port].ty
    }

    fn count_nodes(&self) -> usize {
        self.levels.iter().map(|l| l.dag.node_count()).sum()
    }
}

/// A draft whose edges are looked up.
pub(super) struct Settling {
    pub(super) call: Call,
    pub(super) kind: &'static str,
    pub(super) edges: Vec<EdgeUse>,
    pub(super) options: Options,
    pub(super) inputs: Vec<ValueRef>,
}

/// The graph of a body. Instances are made after those they read, so that their indices are a topological order.
pub(super) fn body_graph(name: String, dag: DiGraph<Instance, Wire>) -> Graph {
    let order = dag.node_indices().collect();
    Graph { name, dag, order, inputs: IndexMap::new(), outputs: IndexMap::new() }
}

/// Whether a value may take the place of another from one iteration to the next: precision may differ.
fn same_shape(a: &EdgeType, b: &EdgeType) -> bool {
    match (a, b) {
        (EdgeType::Image(a), EdgeType::Image(b)) => a.size == b.size && a.channels == b.channels,
        (EdgeType::Volume(a), EdgeType::Volume(b)) => a.size == b.size && a.channels == b.channels,
        _ => a == b,
    }
}

/// Sizes that no machine has.
fn impossible(output: &Output) -> Option<Mistake> {
    const MOST: u32 = 1 << 20;
    let wrong = match output.ty {
        EdgeType::Image(t) => t.size.iter().any(|n| *n == 0 || *n > MOST),
        EdgeType::Volume(t) => t.size.iter().any(|n| *n == 0 || *n > 1 << 14),
        EdgeType::Table(t) => t.len == 0,
        EdgeType::Scalar(_) | EdgeType::Mesh(_) => false,
    };
    wrong.then(|| {
        Mistake::new(format!("would make an {} as `{}`", output.ty, output.name)).hint("every size must be at least 1 and of this world")
    })
}

/// Texts in an `Iterate` body that may name something outside it.
fn captured_texts<'t>(body: &'t Body, texts: &mut Vec<(&'t str, Span)>) {
    let own = |text: &str| {
        let head = text.split('.').next().unwrap_or_default();
        body.calls.iter().any(|c| c.name.value == head) || body.fields.state.contains_key(head)
    };
    let mut found = Vec::new();
    for call in &body.calls {
        for (_, tree) in &call.fields {
            walk(tree, &mut found);
        }
    }
    let until = body.until.as_ref().and_then(|tree| field_of(tree, "value"));
    if let Some((_, tree)) = until {
        walk(tree, &mut found);
    }
    found.extend(body.next.iter().map(|(_, edge)| (edge.value.as_str(), edge.span)));
    texts.extend(found.into_iter().filter(|(text, _)| !own(text)));
}

fn walk<'t>(tree: &'t Tree, found: &mut Vec<(&'t str, Span)>) {
    match &tree.value {
        Syntax::Text(text) => found.push((text, tree.span)),
        Syntax::Tuple(_, values) | Syntax::List(values) => values.iter().for_each(|t| walk(t, found)),
        Syntax::Struct(_, fields) => fields.iter().for_each(|(_, t)| walk(t, found)),
        Syntax::Map(entries) => entries.iter().for_each(|(_, t)| walk(t, found)),
        Syntax::Bool(_) | Syntax::Integer(_) | Syntax::Float(_) | Syntax::None => {}
    }
}
