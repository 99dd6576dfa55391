//! Document → Graph: looks every name up, takes subgraphs and iterations apart, and computes every type.
//!
//! A *scope* is one `nodes` map: of a graph file, of a subgraph instance, or of an `Iterate` body. Each scope is
//! resolved in three steps, so that every mistake in it can be found at once:
//!
//! 1. **draft**: fields of every node are read, which tells the edges that it names ([`draft`]);
//! 2. **link**: names are looked up and cycles found;
//! 3. **settle**: in dependency order, types are computed and instances made ([`scope`]).
//!
//! Nodes are taken in the order of their names, never in the order of the file, so that a plan does not depend on
//! how a map was written. A node whose inputs are already wrong is left out silently: one mistake, one message.

mod draft;
mod scope;
mod settings;
mod subgraph;
mod usage;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use indexmap::IndexMap;
use petgraph::graph::DiGraph;

use crate::de::from_tree;
use crate::diagnostic::{Diagnostic, Diagnostics, Sources};
use crate::document::{Document, Field, Parameter, ParameterType, parse, with_nearest};
use crate::expr::Env;
use crate::graph::{Graph, Instance, Options, ValueRef, Wire, Work};
use crate::node::{Loader, Output, Registry};
use crate::span::{Span, Syntax, Tree};
use crate::syntax::MOST_BYTES;
use crate::types::{EdgeKind, EdgeType, Element};

/// Most nodes that a graph may have once its subgraphs are in place: a guard against graphs that double at
/// every level.
const MOST_NODES: usize = 100_000;

/// What is known from outside when a graph is resolved.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// Types of graph inputs, from the headers of the files bound to them.
    pub inputs: IndexMap<String, EdgeType>,
    /// Distances between the voxels of volume inputs along x, y and z, as `NAME.dx`, `NAME.dy` and `NAME.dz` in expressions; 1
    /// when absent.
    pub spacings: IndexMap<String, [f32; 3]>,
    /// Size that is assumed for inputs that nothing is bound to (`plan --size`), 1920×1080 when absent.
    pub assumed: Option<[u32; 2]>,
    /// `--set NAME=VALUE`: a parameter of the graph, or `node.field`.
    pub settings: Vec<(String, String)>,
    /// Frame number, as `frame` in expressions.
    pub frame: f64,
    /// Seconds since the first frame, as `time` in expressions.
    pub time: f64,
}

/// Resolves a document. Comes back with a graph only when there was no error; warnings may be there all the same.
pub fn resolve(
    document: &Document,
    request: &Request,
    registry: &Registry,
    loader: &dyn Loader,
    sources: &mut Sources,
    diagnostics: &mut Diagnostics,
) -> Option<Graph> {
    let settings = settings::read(&request.settings, sources);
    let mut resolver = Resolver {
        request,
        registry,
        loader,
        sources,
        diagnostics,
        levels: vec![Level::default()],
        chain: vec![normal(&document.path)],
        files: IndexMap::new(),
        settings,
        feedbacks: Vec::new(),
        bodies: 0,
    };
    resolver.graph(document)
}

/// The path without `.` and `..`, for comparing files by name.
fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::CurDir => {}
            std::path::Component::ParentDir if out.file_name().is_some() => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

/// Adds `NAME.dx`, `NAME.dy` and `NAME.dz`.
fn spacing_names(env: &mut Env, name: &str, spacing: [f32; 3]) {
    for (field, distance) in ["dx", "dy", "dz"].into_iter().zip(spacing) {
        env.set(&format!("{name}.{field}"), f64::from(distance));
    }
}

/// The field of a struct, with its value.
fn field_of<'t>(tree: &'t Tree, name: &str) -> Option<&'t Field> {
    match &tree.value {
        Syntax::Struct(_, fields) => fields.iter().find(|(key, _)| key.value == name),
        _ => None,
    }
}

/// Values that a node gives to the parameters of its subgraph, with the place of each name.
type Given = IndexMap<String, (Span, Tree)>;

/// A graph under construction.
#[derive(Default)]
struct Level {
    dag: DiGraph<Instance, Wire>,
    /// In a body: values of the level around it, and what stands for them inside.
    captures: IndexMap<ValueRef, ValueRef>,
}

struct Resolver<'a> {
    request: &'a Request,
    registry: &'a Registry,
    loader: &'a dyn Loader,
    sources: &'a mut Sources,
    diagnostics: &'a mut Diagnostics,
    /// Graphs under construction: of the file, then of the bodies being resolved, the innermost last.
    levels: Vec<Level>,
    /// Files from the outermost one to the one being resolved.
    chain: Vec<PathBuf>,
    /// Subgraph files that were parsed already.
    files: IndexMap<PathBuf, Option<Arc<Document>>>,
    settings: Vec<settings::Setting>,
    /// Feedback nodes whose `next` is not checked yet.
    feedbacks: Vec<(ValueRef, Span)>,
    /// How many `Iterate` bodies are around the current scope.
    bodies: usize,
}

impl Resolver<'_> {
    fn graph(&mut self, document: &Document) -> Option<Graph> {
        let mut inputs = IndexMap::new();
        let mut env = Env::new();
        env.set("frame", self.request.frame);
        env.set("time", self.request.time);
        // Their place in the file decides nothing.
        let mut in_order: Vec<_> = document.inputs.iter().collect();
        in_order.sort_by(|a, b| a.name.value.cmp(&b.name.value));
        for input in in_order {
            let ty = self.request.inputs.get(&input.name.value).copied().unwrap_or_else(|| self.assumed(input.kind));
            if ty.kind() != input.kind {
                self.diagnostics.push(Diagnostic::error(
                    input.name.span,
                    format!("input `{}` takes {}, but the file bound to it is {ty}", input.name.value, article(input.kind)),
                ));
            }
            self.size_names(&mut env, &input.name.value, ty);
            if let Some(spacing) = self.request.spacings.get(&input.name.value) {
                spacing_names(&mut env, &input.name.value, *spacing);
            }
            let node = self.level().dag.add_node(Instance {
                name: input.name.value.clone(),
                kind: "Input",
                span: input.name.span,
                work: Work::Input,
                inputs: Vec::new(),
                outputs: Output::out(ty),
                options: Options::default(),
            });
            inputs.insert(input.name.value.clone(), node);
        }
        for name in self.request.inputs.keys() {
            if !inputs.contains_key(name) {
                let span = document.inputs.first().map_or(document.head, |i| i.name.span);
                let d = Diagnostic::error(span, format!("the graph has no input `{name}`"));
                self.diagnostics.push(with_nearest(d, name, inputs.keys().map(String::as_str)));
            }
        }
        self.params(document, None, "", &mut env);

        let names = inputs.iter().map(|(name, node)| (name.clone(), Some(ValueRef { node: *node, port: 0 }))).collect();
        let folder = document.path.parent().unwrap_or(Path::new("")).to_owned();
        let frame = scope::Frame { prefix: "", env: &env, folder: &folder, outer: None };
        let scope = self.scope(&document.nodes, names, &frame);

        let mut outputs = IndexMap::new();
        for (name, edge) in &document.outputs {
            if let Some(value) = self.lookup(&scope, &frame, &edge.value, edge.span) {
                outputs.insert(name.value.clone(), value);
            }
        }
        self.check_feedbacks();
        self.check_settings(document);
        let dag = std::mem::take(&mut self.level().dag);
        let sinks = usage::sinks(&dag);
        if document.outputs.is_empty() && sinks.is_empty() && !self.means_to_read_back(document) {
            self.diagnostics.push(
                Diagnostic::error(document.head, "nothing leaves the graph")
                    .label("expected `outputs: {\"out\": \"node\"}`")
                    .hint("or add a Readback node"),
            );
        }
        if self.diagnostics.has_errors() {
            return None;
        }
        usage::warn_unused(&dag, outputs.values().copied(), document.file, self.diagnostics);
        // Instances are made after those they read, so that their indices are a topological order.
        let order = dag.node_indices().collect();
        // An output's place in the file decides nothing: outputs are in the order of their names.
        outputs.sort_unstable_keys();
        inputs.sort_unstable_keys();
        Some(Graph { name: document.name.clone(), dag, order, inputs, outputs })
    }

    /// Whether a node acts by itself, right or wrong.
    fn means_to_read_back(&self, document: &Document) -> bool {
        document.nodes.iter().any(|call| {
            let reads = call.options.as_ref().is_some_and(|options| field_of(options, "readback").is_some());
            reads || matches!(call.kind.value.as_str(), "" | "Readback") || self.registry.get(&call.kind.value).is_none()
        })
    }

    /// The graph under construction.
    fn level(&mut self) -> &mut Level {
        self.levels.last_mut().expect("there is always the file's own level")
    }

    fn assumed(&self, kind: EdgeKind) -> EdgeType {
        let size = self.request.assumed.unwrap_or([1920, 1080]);
        match kind {
            EdgeKind::Volume => EdgeType::volume([size[0].min(128), size[1].min(128), 128], 1),
            EdgeKind::Table => EdgeType::table(256, Element::F32),
            _ => EdgeType::image(size, 4),
        }
    }

    /// Adds `NAME.width`, `NAME.height` (and `NAME.depth`, `NAME.channels`, and a spacing of 1).
    fn size_names(&self, env: &mut Env, name: &str, ty: EdgeType) {
        let mut set = |field: &str, v: u32| env.set(&format!("{name}.{field}"), f64::from(v));
        match ty {
            EdgeType::Image(t) => {
                set("width", t.size[0]);
                set("height", t.size[1]);
                set("channels", t.channels.into());
            }
            EdgeType::Volume(t) => {
                set("width", t.size[0]);
                set("height", t.size[1]);
                set("depth", t.size[2]);
                set("channels", t.channels.into());
                spacing_names(env, name, [1.0; 3]);
            }
            EdgeType::Table(t) => set("len", t.len),
            EdgeType::Scalar(_) | EdgeType::Mesh(_) => {}
        }
    }

    /// Evaluates the parameters of a document into `env`: `--set` first, then values given by the node that names the
    /// document, which may use the names around it, then defaults.
    fn params(&mut self, document: &Document, given: Option<(&Given, &Env)>, prefix: &str, env: &mut Env) {
        for parameter in &document.params {
            let name = &parameter.name.value;
            let value = if let Some(tree) = self.setting_of(name, prefix) {
                self.param_value(parameter, &tree, env)
            } else if let Some((tree, around)) = given.and_then(|(values, around)| Some((&values.get(name)?.1, around))) {
                // To a parameter that takes numbers a flag is 1 or 0, as it is to expressions.
                let number = match tree.value {
                    Syntax::Bool(flag) if parameter.ty != ParameterType::Bool => {
                        Some(Tree { value: Syntax::Integer(flag.into()), ..*tree })
                    }
                    _ => None,
                };
                self.param_value(parameter, number.as_ref().unwrap_or(tree), around)
            } else {
                self.param_value(parameter, &parameter.default, env)
            };
            env.set(name, value);
        }
    }

    fn param_value(&mut self, parameter: &Parameter, tree: &Tree, env: &Env) -> f64 {
        let name = &parameter.name.value;
        let mut value = if parameter.ty == ParameterType::Bool {
            let (value, _, mistakes) = from_tree::<bool>(tree, env);
            self.diagnostics.extend(mistakes);
            return f64::from(u8::from(value.unwrap_or_default()));
        } else {
            let (value, _, mistakes) = from_tree::<f64>(tree, env);
            self.diagnostics.extend(mistakes);
            match value {
                Some(value) => value,
                // The mistake is noted; 1 is the value least likely to cause others.
                None => return 1.0,
            }
        };
        let integral = matches!(parameter.ty, ParameterType::I32 | ParameterType::U32);
        if integral && value.fract() != 0.0 {
            self.diagnostics.push(Diagnostic::error(tree.span, format!("`{name}` is {value}")).label("expected a whole number"));
            value = value.round();
        }
        let least = if parameter.ty == ParameterType::U32 { Some(0.0) } else { None };
        let (min, max) = (parameter.min.or(least), parameter.max);
        if min.is_some_and(|m| value < m) || max.is_some_and(|m| value > m) {
            let range = match (min, max) {
                (Some(a), Some(b)) => format!("{a} to {b}"),
                (Some(a), None) => format!("at least {a}"),
                (None, Some(b)) => format!("at most {b}"),
                (None, None) => unreachable!("a bound was broken"),
            };
            self.diagnostics
                .push(Diagnostic::error(tree.span, format!("`{name}` is {value}, out of its range")).label(format!("expected {range}")));
            // With a value in its range nothing else is wrong because of it.
            value = min.unwrap_or(value).max(max.map_or(value, |m| value.min(m)));
        }
        value
    }

    /// Parses a subgraph file once; mistakes in it are reported once.
    fn file(&mut self, path: &Path, place: Span) -> Option<Arc<Document>> {
        let key = normal(path);
        if let Some(known) = self.files.get(&key) {
            return known.clone();
        }
        let read = match self.loader.text(path, MOST_BYTES) {
            Ok(text) => parse(path, &text, self.registry, self.sources, self.diagnostics).map(Arc::new),
            Err(reason) => {
                self.diagnostics.push(
                    Diagnostic::error(place, format!("cannot read the subgraph: {reason}"))
                        .label("expected the path of a graph, relative to this file"),
                );
                None
            }
        };
        self.files.insert(key, read.clone());
        read
    }

    /// `next` of a `Feedback` must have the type of `init`.
    fn check_feedbacks(&mut self) {
        for (at, span) in std::mem::take(&mut self.feedbacks) {
            let dag = &self.level().dag;
            let Work::Feedback { next, .. } = dag[at.node].work else { continue };
            let (init, next) = (dag[at.node].outputs[0].ty, dag[next.node].outputs[next.port].ty);
            if init != next {
                self.diagnostics.push(
                    Diagnostic::error(span, format!("`next` is {next}, but `init` is {init}"))
                        .label("expected a value of the same type as `init`"),
                );
            }
        }
    }
}

/// `an Image`, `a Volume`
pub(crate) fn article(kind: EdgeKind) -> String {
    let article = if kind == EdgeKind::Image { "an" } else { "a" };
    format!("{article} {kind}")
}
