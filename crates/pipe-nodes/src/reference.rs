//! The reference of the library, from the definitions themselves: what `pipe nodes` prints and `docs/nodes.md` holds.

use std::fmt::Write as _;

use pipe_graph::node::{Category, Kind, Registry, Tolerance};
use serde_json::{Value, json};

const SECTIONS: [(Category, &str); 8] = [
    (Category::Filters, "Filters"),
    (Category::Colour, "Colour and tone"),
    (Category::Composite, "Composite and geometry"),
    (Category::Analysis, "Analysis and tables"),
    (Category::Simulation, "Iteration and simulation"),
    (Category::Volumes, "Scattering and volumes"),
    (Category::Sources, "Sources"),
    (Category::Structure, "Structure"),
];

/// The first sentence of a node's description.
fn summary(schema: &Value) -> String {
    let text = schema["description"].as_str().unwrap_or_default();
    let text = text.split("\n\n").next().unwrap_or_default().replace('\n', " ");
    text.split_once(". ").map_or(text.clone(), |(first, _)| format!("{first}."))
}

/// Every node in a line.
pub fn list(registry: &Registry) -> String {
    let mut out = String::new();
    for (category, title) in SECTIONS {
        let kinds: Vec<_> = registry.iter().filter(|k| k.category == category).collect();
        if kinds.is_empty() {
            continue;
        }
        let _ = writeln!(out, "{title}");
        for kind in kinds {
            let schema = json!((kind.schema)());
            let _ = writeln!(out, "  {:<22} {}", kind.name, summary(&schema));
        }
        out.push('\n');
    }
    out.push_str("`pipe nodes NAME` prints the reference of one of them.\n");
    out
}

/// What a property accepts, in words.
fn type_of(property: &Value, root: &Value) -> String {
    if let Some(edge) = property.get("x-edge").and_then(Value::as_str) {
        return edge.to_owned();
    }
    if property.get("x-driven").is_some() {
        return "number ~".to_owned();
    }
    if let Some(reference) = property.get("$ref").and_then(Value::as_str) {
        let name = reference.rsplit('/').next().unwrap_or_default();
        return type_of(&root["$defs"][name], root);
    }
    if let Some(all) = property.get("allOf").and_then(Value::as_array) {
        return all.first().map(|p| type_of(p, root)).unwrap_or_default();
    }
    for key in ["oneOf", "anyOf"] {
        if let Some(choices) = property.get(key).and_then(Value::as_array) {
            let mut names: Vec<String> =
                choices.iter().filter(|c| c.get("type").is_none_or(|t| t != "null")).map(|c| type_of(c, root)).collect();
            names.dedup();
            return names.join(" | ");
        }
    }
    if let Some(value) = property.get("const").and_then(Value::as_str) {
        return value.to_owned();
    }
    if let Some(values) = property.get("enum").and_then(Value::as_array) {
        return values.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(" | ");
    }
    let ty = match property.get("type") {
        Some(Value::Array(list)) => list.iter().filter_map(Value::as_str).find(|t| *t != "null").unwrap_or_default(),
        Some(Value::String(t)) => t,
        _ => "",
    };
    match ty {
        "array" => match property.get("prefixItems").and_then(Value::as_array) {
            Some(items) => format!("({})", items.iter().map(|i| type_of(i, root)).collect::<Vec<_>>().join(", ")),
            None => format!("[{}]", property.get("items").map(|i| type_of(i, root)).unwrap_or_default()),
        },
        // A variant with fields: `{"Importance": {"samples": …}}`.
        "object" => match property.get("properties").and_then(Value::as_object).filter(|p| p.len() == 1) {
            Some(one) => {
                let (name, inner) = one.iter().next().expect("there is one");
                match inner.get("properties").and_then(Value::as_object) {
                    Some(fields) => format!("{name}({})", fields.keys().map(|k| format!("{k}: …")).collect::<Vec<_>>().join(", ")),
                    None => format!("{name}({})", type_of(inner, root)),
                }
            }
            None if property.get("properties").is_some() => "struct".to_owned(),
            None => "map".to_owned(),
        },
        "string" => "text".to_owned(),
        other => other.to_owned(),
    }
}

/// A property that is a struct of several fields, such as a camera.
fn parts<'a>(property: &Value, root: &'a Value) -> Option<&'a serde_json::Map<String, Value>> {
    let name = property.get("$ref").and_then(Value::as_str)?.rsplit('/').next()?;
    root["$defs"][name]["properties"].as_object()
}

/// The fields of a node with their schemas; those of a struct follow it, as `camera.eye`.
fn fields(schema: &Value) -> Vec<(String, &Value)> {
    let mut all = Vec::new();
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        all.push((name.clone(), property));
        let inner = parts(property, schema).into_iter().flatten();
        all.extend(inner.map(|(part, property)| (format!("{name}.{part}"), property)));
    }
    all
}

fn range(property: &Value) -> String {
    let bound = |name: &str| property.get(name).and_then(Value::as_f64);
    match (bound("minimum"), bound("maximum")) {
        (Some(a), Some(b)) => format!("{a} to {b}"),
        (Some(a), None) => format!("at least {a}"),
        (None, Some(b)) => format!("at most {b}"),
        (None, None) => String::new(),
    }
}

fn default(property: &Value) -> String {
    match property.get("default") {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(s)) => s.clone(),
        Some(Value::Number(n)) => match n.as_f64() {
            // Defaults are stored as 32-bit floats; show the number that was meant.
            Some(v) if n.is_f64() => format!("{}", v as f32),
            _ => n.to_string(),
        },
        // The defaults of a struct stand at its fields.
        Some(Value::Object(_)) => String::new(),
        Some(Value::Array(list)) => {
            let entries: Vec<String> = list.iter().map(|v| default(&json!({"default": v}))).collect();
            format!("({})", entries.join(", "))
        }
        Some(other) => other.to_string(),
    }
}

/// The reference of one node, as text.
pub fn entry(kind: &Kind) -> String {
    let schema = json!((kind.schema)());
    let mut out = format!("{}\n\n", kind.name);
    if let Some(text) = schema["description"].as_str() {
        let _ = writeln!(out, "{text}\n");
    }
    for (name, property) in fields(&schema) {
        let unit = property.get("x-unit").and_then(Value::as_str).unwrap_or_default();
        let mut facts = vec![type_of(property, &schema)];
        let (r, d) = (range(property), default(property));
        if !r.is_empty() {
            facts.push(r);
        }
        if !unit.is_empty() {
            facts.push(unit.to_owned());
        }
        if !d.is_empty() {
            facts.push(format!("default {d}"));
        }
        let text = property["description"].as_str().unwrap_or_default().replace('\n', " ");
        let _ = writeln!(out, "  {:<16} {}\n  {:<16} {text}", name, facts.join(", "), "");
    }
    if !kind.ports.is_empty() {
        out.push_str("\nports\n");
        for (name, text) in kind.ports {
            let _ = writeln!(out, "  {name:<16} {text}");
        }
    }
    if !kind.ports.is_empty() {
        let _ = writeln!(out, "\naccuracy\n  {}", accuracy(kind.tolerance));
    }
    if !kind.examples.is_empty() {
        out.push_str("\nexamples\n");
        for example in kind.examples.iter().take(4) {
            let _ = writeln!(out, "  {example}");
        }
    }
    out
}

/// The reference page, as Markdown.
pub fn page(registry: &Registry) -> String {
    let mut out = String::from(
        "# Nodes\n\nGenerated from the definitions by `pipe nodes --markdown`; do not edit. `~` marks a number that a Scalar edge may drive. \
         Every node also takes `options: (format: F32 | F16 | Auto, border: Clamp | Mirror | Repeat | Black, filter: Nearest | Linear, repeat: 8, when: \"=flag\", readback: \"path\")`.\n",
    );
    for (category, title) in SECTIONS {
        let kinds: Vec<_> = registry.iter().filter(|k| k.category == category).collect();
        if kinds.is_empty() {
            continue;
        }
        let _ = writeln!(out, "\n## {title}");
        for kind in kinds {
            let schema = json!((kind.schema)());
            let _ = writeln!(out, "\n### {}\n\n{}\n", kind.name, schema["description"].as_str().unwrap_or_default());
            out.push_str("| field | type | default | range | meaning |\n|---|---|---|---|---|\n");
            for (name, property) in fields(&schema) {
                let cell = |text: String| text.replace('|', "\\|").replace('\n', " ");
                let unit = property.get("x-unit").and_then(Value::as_str).unwrap_or_default();
                let _ = writeln!(
                    out,
                    "| `{name}` | {} | {} | {} {unit} | {} |",
                    cell(type_of(property, &schema)),
                    cell(default(property)),
                    range(property),
                    cell(property["description"].as_str().unwrap_or_default().to_owned())
                );
            }
            if !kind.ports.is_empty() {
                let _ = writeln!(out, "\nAccuracy: {}.", accuracy(kind.tolerance));
            }
            if kind.ports.len() > 1 {
                let ports: Vec<_> = kind.ports.iter().map(|(name, text)| format!("`{name}` ({text})")).collect();
                let _ = writeln!(out, "\nPorts: {}.", ports.join(", "));
            }
            if let Some(example) = kind.examples.first() {
                let _ = writeln!(out, "\n```ron\n{example}\n```");
            }
        }
    }
    out
}

/// How far results on any device may be from double precision.
fn accuracy(tolerance: Tolerance) -> String {
    let Tolerance { absolute, relative, strays } = tolerance;
    if absolute == 0.0 && relative == 0.0 {
        return "equal to double precision, rounded once".to_owned();
    }
    let but = if strays > 0.0 { format!("; chance may decide {} % of the values otherwise", strays * 100.0) } else { String::new() };
    format!("within {absolute:e} + {relative:e}·|value| of double precision{but}")
}

/// The whole library as JSON: name, category, ports, examples and schema of every kind.
pub fn to_json(registry: &Registry) -> Value {
    let one = |k: &Kind| {
        let ports: Vec<_> = k.ports.iter().map(|(name, text)| json!({"name": name, "doc": text})).collect();
        json!({"name": k.name, "category": k.category, "ports": ports, "examples": k.examples, "tolerance": k.tolerance, "schema": (k.schema)()})
    };
    registry.iter().map(one).collect()
}
