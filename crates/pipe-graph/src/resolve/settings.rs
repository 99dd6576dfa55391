//! `--set NAME=VALUE`: values from the command line in place of those in the file.

use std::path::Path;

use super::Resolver;
use crate::diagnostic::{Diagnostic, Sources};
use crate::document::{Call, Document, with_nearest};
use crate::span::{Span, Spanned, Syntax, Tree};
use crate::syntax::parse_tree;

/// One `--set`, parsed.
pub(super) struct Setting {
    name: String,
    value: Tree,
    used: bool,
}

/// Parses all of them.
pub(super) fn read(settings: &[(String, String)], sources: &mut Sources) -> Vec<Setting> {
    let read = |(name, text): &(String, String)| {
        let file = sources.add(Path::new("--set"), text);
        // A value that is no RON is taken as plain text, so that the shell needs no second pair of quotes.
        let value =
            parse_tree(text, file).unwrap_or_else(|_| Tree { span: Span::new(file, 0..text.len()), value: Syntax::Text(text.clone()) });
        Setting { name: name.clone(), value, used: false }
    };
    settings.iter().map(read).collect()
}

impl Resolver<'_> {
    /// What is set of a parameter of the graph whose nodes have this prefix.
    pub(super) fn setting_of(&mut self, parameter: &str, prefix: &str) -> Option<Tree> {
        let mut names = vec![format!("{prefix}{parameter}")];
        // Of a subgraph's parameter, `glow/key`, `glow.key` and `glow.params.key` are names.
        if let Some(node) = prefix.strip_suffix('/') {
            names.extend([format!("{node}.{parameter}"), format!("{node}.params.{parameter}")]);
        }
        let setting = self.settings.iter_mut().find(|setting| names.contains(&setting.name))?;
        setting.used = true;
        Some(setting.value.clone())
    }

    /// Puts what is set of a node into its call.
    pub(super) fn apply_settings(&mut self, call: &mut Call, prefix: &str) {
        let node = format!("{prefix}{}", call.name.value);
        for setting in &mut self.settings {
            let Some(path) = setting.name.strip_prefix(&node).and_then(|rest| rest.strip_prefix('.')) else { continue };
            let mut path: Vec<&str> = path.split('.').collect();
            // What is no field of a Subgraph is a parameter of its graph, set where that is resolved.
            if call.kind.value == "Subgraph" && !["file", "inputs", "options"].contains(&path[0]) {
                continue;
            }
            setting.used = true;
            // The parameters that a Wgsl node declares are set like the fields of other nodes, which go first.
            let schema = self.registry.get(&call.kind.value).map(|kind| (kind.schema)());
            let is_field = schema.is_some_and(|schema| schema.get("properties").is_some_and(|fields| fields.get(path[0]).is_some()));
            let params = call.fields.iter().find(|(key, _)| key.value == "params");
            if !is_field && params.is_some_and(|(_, tree)| has_key(tree, path[0])) {
                path.insert(0, "params");
            }
            if path[0] == "options" && call.options.is_none() {
                call.options = Some(Tree { span: setting.value.span, value: Syntax::Struct(None, Vec::new()) });
            }
            let place = match path[0] {
                "options" => call.options.as_mut(),
                field => call.fields.iter_mut().find(|(key, _)| key.value == field).map(|(_, tree)| tree),
            };
            let done = match place {
                Some(tree) => put(tree, &path[1..], &setting.value),
                None if path.len() == 1 => {
                    call.fields.push((Spanned { span: setting.value.span, value: path[0].to_owned() }, setting.value.clone()));
                    true
                }
                None => false,
            };
            if !done {
                let message = format!("--set {}: `{node}` has no `{}`", setting.name, path.join("."));
                self.diagnostics.push(Diagnostic::error(setting.value.span, message).label("there is no such place in the node"));
            }
        }
    }

    /// A setting that nothing in the graph took is a mistake.
    pub(super) fn check_settings(&mut self, document: &Document) {
        let nodes = self.level().dag.node_weights().map(|i| i.name.clone());
        let known: Vec<String> = document.params.iter().map(|p| p.name.value.clone()).chain(nodes).collect();
        for setting in std::mem::take(&mut self.settings) {
            if !setting.used {
                let d = Diagnostic::error(setting.value.span, format!("--set {}: there is no such parameter or node", setting.name));
                let node = setting.name.split('.').next().unwrap_or_default();
                self.diagnostics.push(with_nearest(d, node, known.iter().map(String::as_str)));
            }
        }
    }
}

fn is_text(tree: &Tree, text: &str) -> bool {
    matches!(&tree.value, Syntax::Text(own) if own == text)
}

fn has_key(tree: &Tree, name: &str) -> bool {
    matches!(&tree.value, Syntax::Map(entries) if entries.iter().any(|(key, _)| is_text(key, name)))
}

/// Puts a value where a path of fields and keys leads; false when it leads nowhere. A struct gains the field that it
/// lacks, a map gains nothing.
fn put(place: &mut Tree, path: &[&str], value: &Tree) -> bool {
    let declares = |fields: &[(Spanned<String>, Tree)]| fields.iter().any(|(key, _)| key.value == "default");
    let Some((step, rest)) = path.split_first() else {
        match &mut place.value {
            // What declares a parameter keeps its type: `3` for `F32(default: 2)`.
            Syntax::Struct(Some(_), fields) if declares(fields) && !matches!(value.value, Syntax::Struct(..)) => {
                return put(place, &["default"], value);
            }
            _ => *place = value.clone(),
        }
        return true;
    };
    match &mut place.value {
        Syntax::Struct(_, fields) => match fields.iter_mut().find(|(key, _)| key.value == *step) {
            Some((_, tree)) => put(tree, rest, value),
            None if rest.is_empty() => {
                fields.push((Spanned { span: value.span, value: (*step).to_owned() }, value.clone()));
                true
            }
            None => false,
        },
        Syntax::Map(entries) => entries.iter_mut().find(|(key, _)| is_text(key, step)).is_some_and(|(_, tree)| put(tree, rest, value)),
        _ => false,
    }
}
