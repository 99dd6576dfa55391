//! The document: what the user wrote, with the place of every part, before any name is looked up.
//!
//! Parsing collects every mistake of form: unknown sections, duplicate names, nodes that are no nodes. What a
//! field of a node means is decided when the node is resolved, because an expression may need the size of an
//! image; so fields stay trees here.

use std::path::{Path, PathBuf};

use indexmap::IndexMap;

use crate::diagnostic::{Diagnostic, Diagnostics, Sources, nearest};
use crate::node::Registry;
use crate::span::{FileId, Span, Spanned, Syntax, Tree};
use crate::syntax::parse_tree;
use crate::types::EdgeKind;

/// The newest language version that this program reads.
pub const VERSION: u32 = 1;

/// A field of a node call: its name and its value.
pub type Field = (Spanned<String>, Tree);

/// The type of a graph parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub enum ParameterType {
    /// 32-bit float.
    F32,
    /// Signed integer.
    I32,
    /// Unsigned integer.
    U32,
    /// `true` or `false`; 1 or 0 in expressions.
    Bool,
}

/// A parameter of a graph.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: Spanned<String>,
    /// Its type.
    pub ty: ParameterType,
    /// Value when nobody sets it: a number, a bool, or an expression over earlier parameters.
    pub default: Tree,
    /// Smallest allowed value.
    pub min: Option<f64>,
    /// Largest allowed value.
    pub max: Option<f64>,
    /// A sentence for `pipe info`.
    pub doc: String,
}

/// An input of a graph.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Its name.
    pub name: Spanned<String>,
    /// Image, Volume or Table.
    pub kind: EdgeKind,
    /// A sentence for `pipe info`.
    pub doc: String,
}

/// One entry of `nodes`.
#[derive(Debug, Clone, PartialEq)]
pub struct Call {
    /// The name of the node.
    pub name: Spanned<String>,
    /// Its kind.
    pub kind: Spanned<String>,
    /// Its fields without `options`.
    pub fields: Vec<Field>,
    /// `options`
    pub options: Option<Tree>,
    /// The whole call.
    pub span: Span,
}

/// What the user wrote.
#[derive(Debug, Clone, PartialEq)]
pub struct Document {
    /// The file.
    pub path: PathBuf,
    /// Its id among the sources.
    pub file: FileId,
    /// The word `Graph`: the place of what is missing.
    pub head: Span,
    /// `name`, or the file's stem.
    pub name: String,
    /// `doc`
    pub doc: String,
    /// `params`
    pub params: Vec<Parameter>,
    /// `inputs`
    pub inputs: Vec<Input>,
    /// `nodes`
    pub nodes: Vec<Call>,
    /// `outputs`: name and edge.
    pub outputs: Vec<(Spanned<String>, Spanned<String>)>,
}

/// Parses one graph file. Mistakes are added to `diagnostics`; a document comes back whenever the text is RON,
/// so that later stages can find more mistakes.
pub fn parse(path: &Path, text: &str, registry: &Registry, sources: &mut Sources, diagnostics: &mut Diagnostics) -> Option<Document> {
    let file = sources.add(path, text);
    let tree = match parse_tree(text, file) {
        Ok(tree) => tree,
        Err(mistake) => {
            diagnostics.push(mistake);
            return None;
        }
    };
    let Syntax::Struct(head, fields) = &tree.value else {
        diagnostics.push(
            Diagnostic::error(tree.span, "a graph file is one `Graph(…)`").label("expected `Graph(version: 1, nodes: {…}, outputs: {…})`"),
        );
        return None;
    };
    if let Some(head) = head
        && head.value != "Graph"
    {
        diagnostics.push(Diagnostic::error(head.span, format!("`{}` is no graph", head.value)).label("expected `Graph`"));
    }
    let one = Span { end: tree.span.start + 1, ..tree.span };
    let mut reader = Reader { registry, diagnostics };
    Some(reader.graph(path, file, head.as_ref().map_or(one, |h| h.span), fields))
}

const SECTIONS: [&str; 7] = ["version", "name", "doc", "params", "inputs", "nodes", "outputs"];

/// Reads sections and notes mistakes.
pub(crate) struct Reader<'a> {
    pub(crate) registry: &'a Registry,
    pub(crate) diagnostics: &'a mut Diagnostics,
}

impl Reader<'_> {
    fn graph(&mut self, path: &Path, file: FileId, head: Span, fields: &[Field]) -> Document {
        let mut sections: IndexMap<&str, &Tree> = IndexMap::new();
        // Sections that are there under a misspelt name are not missing as well.
        let mut misspelt = Vec::new();
        for (key, value) in fields {
            if !SECTIONS.contains(&key.value.as_str()) {
                let d = Diagnostic::error(key.span, format!("unknown section `{}`", key.value))
                    .label(format!("expected one of {}", SECTIONS.join(", ")));
                self.diagnostics.push(with_nearest(d, &key.value, SECTIONS));
                misspelt.extend(nearest(&key.value, SECTIONS));
            } else if sections.contains_key(key.value.as_str()) {
                let d = Diagnostic::error(key.span, format!("`{}` is given twice", key.value));
                self.diagnostics.push(d.label("remove one of them"));
            } else {
                sections.insert(&key.value, value);
            }
        }
        match sections.get("version").map(|t| (&t.value, t.span)) {
            None if misspelt.contains(&"version") => {}
            None => self.diagnostics.push(
                Diagnostic::error(head, "the graph names no version")
                    .label("expected `version: 1`")
                    .hint(format!("this program reads versions up to {VERSION}")),
            ),
            Some((Syntax::Integer(v), _)) if (1..=i128::from(VERSION)).contains(v) => {}
            Some((Syntax::Integer(v), span)) if *v > i128::from(VERSION) => self.diagnostics.push(
                Diagnostic::error(span, format!("version {v} is newer than this program"))
                    .label(format!("expected at most {VERSION}"))
                    .hint("update pipe to read this graph"),
            ),
            Some((_, span)) => {
                self.diagnostics.push(Diagnostic::error(span, "this is no version").label(format!("expected `{VERSION}`")));
            }
        }
        let name = sections.get("name").and_then(|t| self.text(t)).map(|t| t.value);
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let doc = sections.get("doc").and_then(|t| self.text(t)).map(|t| t.value).unwrap_or_default();
        let params = sections.get("params").map(|t| self.params(t)).unwrap_or_default();
        let inputs = sections.get("inputs").map(|t| self.inputs(t)).unwrap_or_default();
        let mut nodes = match sections.get("nodes") {
            Some(nodes) => self.calls(nodes),
            None => {
                if !misspelt.contains(&"nodes") {
                    self.diagnostics.push(Diagnostic::error(head, "the graph has no nodes").label("expected `nodes: {…}`"));
                }
                Vec::new()
            }
        };
        nodes.retain(|call| {
            let free = inputs.iter().all(|input| input.name.value != call.name.value);
            if !free {
                self.diagnostics.push(
                    Diagnostic::error(call.name.span, format!("`{}` is already the name of a graph input", call.name.value))
                        .label("the name is taken")
                        .hint("give the node another name"),
                );
            }
            free
        });
        let outputs = sections.get("outputs").map(|t| self.outputs(t)).unwrap_or_default();
        Document { path: path.to_owned(), file, head, name: name.unwrap_or(stem), doc, params, inputs, nodes, outputs }
    }

    fn text(&mut self, tree: &Tree) -> Option<Spanned<String>> {
        match &tree.value {
            Syntax::Text(text) => Some(Spanned { span: tree.span, value: text.clone() }),
            // What was meant is clear, so that nothing else is wrong because of it.
            Syntax::Tuple(Some(name), values) if values.is_empty() => {
                self.diagnostics.push(
                    Diagnostic::error(tree.span, format!("`{}` stands without quotes", name.value))
                        .label(format!("expected `\"{}\"`", name.value)),
                );
                Some(name.clone())
            }
            _ => {
                self.diagnostics.push(Diagnostic::error(tree.span, "this is no text").label("expected a string in quotes"));
                None
            }
        }
    }

    /// The entries of a map with text keys; duplicates are reported and left out.
    pub(crate) fn entries<'t>(&mut self, tree: &'t Tree, what: &str) -> Vec<(Spanned<String>, &'t Tree)> {
        let entries = match &tree.value {
            Syntax::Map(entries) => entries,
            _ => {
                self.diagnostics
                    .push(Diagnostic::error(tree.span, format!("{what} are written as a map")).label("expected `{ \"name\": … }`"));
                return Vec::new();
            }
        };
        let mut read: Vec<(Spanned<String>, &Tree)> = Vec::new();
        for (key, value) in entries {
            let Some(name) = self.text(key) else { continue };
            if read.iter().any(|(other, _)| other.value == name.value) {
                self.diagnostics.push(
                    Diagnostic::error(name.span, format!("`{}` is defined twice", name.value))
                        .label("the name is taken")
                        .hint("names are unique; rename one of them"),
                );
            } else {
                read.push((name, value));
            }
        }
        read
    }

    fn check_name(&mut self, name: &Spanned<String>) {
        let first = name.value.chars().next();
        let fits =
            first.is_some_and(|c| c.is_alphabetic() || c == '_') && name.value.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-');
        if !fits {
            self.diagnostics.push(
                Diagnostic::error(name.span, format!("`{}` cannot be a name", name.value))
                    .label("expected letters, digits, `_` and `-`, beginning with a letter"),
            );
        }
    }

    fn params(&mut self, tree: &Tree) -> Vec<Parameter> {
        let mut params = Vec::new();
        for (name, value) in self.entries(tree, "params") {
            self.check_name(&name);
            params.push(self.param(name, value));
        }
        params
    }

    /// A parameter; one that is wrong is there all the same, so that its name is known where it is used.
    fn param(&mut self, name: Spanned<String>, value: &Tree) -> Parameter {
        const TYPES: [&str; 4] = ["F32", "I32", "U32", "Bool"];
        let stand_in = Tree { span: value.span, value: Syntax::Integer(1) };
        let mut read = Parameter { name, ty: ParameterType::F32, default: stand_in.clone(), min: None, max: None, doc: String::new() };
        let (head, fields) = match &value.value {
            Syntax::Struct(Some(head), fields) => (head, fields.as_slice()),
            Syntax::Tuple(Some(head), values) if values.is_empty() => (head, [].as_slice()),
            _ => {
                self.diagnostics.push(
                    Diagnostic::error(value.span, format!("`{}` is no parameter", read.name.value))
                        .label("expected such as `F32(default: 1.0, min: 0.0, max: 2.0, doc: \"…\")`"),
                );
                return read;
            }
        };
        read.ty = match head.value.as_str() {
            "F32" => ParameterType::F32,
            "I32" => ParameterType::I32,
            "U32" => ParameterType::U32,
            "Bool" => ParameterType::Bool,
            other => {
                let d = Diagnostic::error(head.span, format!("unknown parameter type `{other}`"))
                    .label(format!("expected one of {}", TYPES.join(", ")));
                self.diagnostics.push(with_nearest(d, other, TYPES));
                return read;
            }
        };
        let mut default = None;
        for (key, value) in fields {
            match key.value.as_str() {
                "default" => default = Some(value.clone()),
                "min" => read.min = self.number(value),
                "max" => read.max = self.number(value),
                "doc" => read.doc = self.text(value).map(|t| t.value).unwrap_or_default(),
                other => {
                    let names = ["default", "min", "max", "doc"];
                    let d = Diagnostic::error(key.span, format!("a parameter has no `{other}`"))
                        .label(format!("expected one of {}", names.join(", ")));
                    self.diagnostics.push(with_nearest(d, other, names));
                }
            }
        }
        if let Some(default) = default {
            read.default = default;
        } else {
            (read.min, read.max) = (None, None);
            self.diagnostics.push(
                Diagnostic::error(value.span, format!("parameter `{}` has no default", read.name.value)).label("expected `default: …`"),
            );
        }
        read
    }

    fn number(&mut self, tree: &Tree) -> Option<f64> {
        match tree.value {
            Syntax::Integer(v) => Some(v as f64),
            Syntax::Float(v) => Some(v),
            _ => {
                self.diagnostics.push(Diagnostic::error(tree.span, "this is no number").label("expected a number"));
                None
            }
        }
    }

    fn inputs(&mut self, tree: &Tree) -> Vec<Input> {
        const KINDS: [(&str, EdgeKind); 3] = [("Image", EdgeKind::Image), ("Volume", EdgeKind::Volume), ("Table", EdgeKind::Table)];
        let mut inputs = Vec::new();
        for (name, value) in self.entries(tree, "inputs") {
            self.check_name(&name);
            let (head, fields) = match &value.value {
                Syntax::Tuple(Some(head), values) if values.is_empty() => (head, [].as_slice()),
                Syntax::Struct(Some(head), fields) => (head, fields.as_slice()),
                _ => {
                    self.diagnostics
                        .push(Diagnostic::error(value.span, "this is no type of input").label("expected Image, Volume or Table"));
                    inputs.push(Input { name, kind: EdgeKind::Image, doc: String::new() });
                    continue;
                }
            };
            let Some((_, kind)) = KINDS.iter().find(|(n, _)| *n == head.value) else {
                let d = Diagnostic::error(head.span, format!("a graph cannot take `{}` as an input", head.value))
                    .label("expected Image, Volume or Table");
                self.diagnostics.push(with_nearest(d, &head.value, KINDS.map(|k| k.0)));
                inputs.push(Input { name, kind: EdgeKind::Image, doc: String::new() });
                continue;
            };
            let mut doc = String::new();
            for (key, value) in fields {
                if key.value == "doc" {
                    doc = self.text(value).map(|t| t.value).unwrap_or_default();
                } else {
                    self.diagnostics.push(Diagnostic::error(key.span, format!("an input has no `{}`", key.value)).label("expected `doc`"));
                }
            }
            inputs.push(Input { name, kind: *kind, doc });
        }
        inputs
    }

    /// The calls of a `nodes` map, or of an `Iterate` body.
    pub(crate) fn calls(&mut self, tree: &Tree) -> Vec<Call> {
        let mut calls = Vec::new();
        for (name, value) in self.entries(tree, "nodes") {
            self.check_name(&name);
            // What is no call is kept as one of no kind, so that its name is known where it is used.
            let call = self.call(&name, value).unwrap_or_else(|| Call {
                kind: Spanned { span: value.span, value: String::new() },
                name,
                fields: Vec::new(),
                options: None,
                span: value.span,
            });
            calls.push(call);
        }
        calls
    }

    fn call(&mut self, name: &Spanned<String>, value: &Tree) -> Option<Call> {
        let (kind, fields) = match &value.value {
            Syntax::Struct(Some(kind), fields) => (kind, fields.clone()),
            Syntax::Tuple(Some(kind), values) if values.is_empty() => (kind, Vec::new()),
            Syntax::Tuple(Some(kind), values) => {
                self.diagnostics.push(
                    Diagnostic::error(values[0].span, format!("the fields of `{}` have names", kind.value))
                        .label("expected `field: value`")
                        .hint(format!("`pipe nodes {}` lists them", kind.value)),
                );
                return None;
            }
            _ => {
                self.diagnostics.push(
                    Diagnostic::error(value.span, format!("`{}` is no node", name.value))
                        .label("expected such as `Exposure(image: \"in\", ev: 1)`"),
                );
                return None;
            }
        };
        if self.registry.get(&kind.value).is_none() {
            let d = Diagnostic::error(kind.span, format!("there is no node kind `{}`", kind.value)).label("unknown kind");
            let mut d = with_nearest(d, &kind.value, self.registry.iter().map(|k| k.name));
            if d.hint.is_none() {
                d = d.hint("`pipe nodes` lists all kinds");
            }
            self.diagnostics.push(d);
        }
        let mut options = None;
        let mut kept = Vec::with_capacity(fields.len());
        for (key, tree) in fields {
            if key.value != "options" {
                kept.push((key, tree));
            } else if options.replace(tree).is_some() {
                self.diagnostics.push(Diagnostic::error(key.span, "`options` is given twice").label("remove one of them"));
            }
        }
        Some(Call { name: name.clone(), kind: kind.clone(), fields: kept, options, span: value.span })
    }

    /// Pairs of a name and an edge.
    pub(crate) fn outputs(&mut self, tree: &Tree) -> Vec<(Spanned<String>, Spanned<String>)> {
        let entries = self.entries(tree, "outputs");
        entries.into_iter().filter_map(|(name, value)| Some((name, self.text(value)?))).collect()
    }
}

/// Adds `did you mean` when a candidate is near.
pub(crate) fn with_nearest<'c>(d: Diagnostic, name: &str, candidates: impl IntoIterator<Item = &'c str>) -> Diagnostic {
    match nearest(name, candidates) {
        Some(near) => d.hint(format!("did you mean `{near}`?")),
        None => d,
    }
}
