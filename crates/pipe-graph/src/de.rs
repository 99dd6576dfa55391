//! A [`Tree`] into the fields of a node, with every mistake of the node at its place.
//!
//! serde stops at the first mistake. Since all fields have defaults, [`build_node`] notes it, takes the field at
//! fault away and tries again, until the rest is right; so a user sees all mistakes of a node at once.
//!
//! Beyond plain serde: a number may be an expression (`"=2*key"`), and the newtypes of [`crate::field`] ask, by
//! their names, for an edge, for a number or an edge, and so on.

use std::cell::RefCell;
use std::fmt;

use schemars::Schema;
use serde::de::{self, DeserializeOwned, DeserializeSeed, EnumAccess, IntoDeserializer, MapAccess, SeqAccess, VariantAccess, Visitor};

use crate::diagnostic::{Diagnostic, nearest};
use crate::expr::{Env, Expr};
use crate::field::{Driven, Operand, kinds_of_token};
use crate::node::{Kind, Node};
use crate::span::{Span, Spanned, Syntax, Tree};
use crate::types::EdgeKind;

/// What went wrong, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct Error {
    /// What.
    pub message: String,
    /// What was expected.
    pub label: String,
    /// The next step.
    pub hint: Option<String>,
    /// Where, when it is known.
    pub span: Option<Span>,
}

impl Error {
    fn at(span: Span, message: impl Into<String>, label: impl Into<String>) -> Self {
        Self { message: message.into(), label: label.into(), hint: None, span: Some(span) }
    }

    fn diagnostic(self, whole: Span) -> Diagnostic {
        let d = Diagnostic::error(self.span.unwrap_or(whole), self.message).label(self.label);
        match self.hint {
            Some(hint) => d.hint(hint),
            None => d,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Error {}

impl de::Error for Error {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self { message: message.to_string(), label: String::new(), hint: None, span: None }
    }

    fn invalid_type(found: de::Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::custom(format!("found {found}, expected {expected}"))
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        let mut e = Self::custom(format!("there is no `{variant}` here"));
        e.label = format!("expected one of {}", expected.join(", "));
        e.hint = nearest(variant, expected.iter().copied()).map(|n| format!("did you mean `{n}`?"));
        e
    }

    fn missing_field(field: &'static str) -> Self {
        let mut e = Self::custom(format!("`{field}` is missing"));
        e.label = format!("expected `{field}: …`");
        e
    }
}

/// An edge that a field named.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeUse {
    /// The path of the field: `image`, `inputs.a`.
    pub field: String,
    /// Kinds that the field accepts.
    pub kinds: Vec<EdgeKind>,
    /// What the file says: `node`, `node.port` or a graph input.
    pub text: String,
    /// Where it says so.
    pub span: Span,
}

/// What a deserialisation knows and collects.
struct Context<'a> {
    env: &'a Env,
    edges: RefCell<Vec<EdgeUse>>,
    path: RefCell<Vec<String>>,
}

/// A serde deserializer over a tree.
#[derive(Clone, Copy)]
pub struct TreeDeserializer<'a> {
    tree: &'a Tree,
    cx: &'a Context<'a>,
}

/// What came of a node's fields.
pub struct Built {
    /// The node, unless a mistake is left that has no field of its own.
    pub node: Option<Box<dyn Node>>,
    /// Edges, by [`EdgeIndex`](crate::field::EdgeIndex).
    pub edges: Vec<EdgeUse>,
    /// Every mistake.
    pub diagnostics: Vec<Diagnostic>,
}

/// Reads the fields of a node of this kind.
pub fn build_node(kind: &Kind, fields: &[(Spanned<String>, Tree)], whole: Span, env: &Env) -> Built {
    let tree = Tree { span: whole, value: Syntax::Struct(None, fields.to_vec()) };
    let (node, edges, mut diagnostics) = read(&tree, env, kind.build);
    let schema = (kind.schema)();
    check_ranges(&schema, fields, env, &mut diagnostics);
    for name in required_inputs(&schema) {
        if !fields.iter().any(|(key, _)| key.value == name) {
            diagnostics.push(Diagnostic::error(whole, format!("missing input `{name}`")).label(format!("expected `{name}: \"NAME\"`")));
        }
    }
    let node = if diagnostics.is_empty() { node } else { None };
    Built { node, edges, diagnostics }
}

/// Reads any value, with every mistake where it is a struct.
pub fn from_tree<T: DeserializeOwned>(tree: &Tree, env: &Env) -> (Option<T>, Vec<EdgeUse>, Vec<Diagnostic>) {
    let (value, edges, diagnostics) = read(tree, env, |d| T::deserialize(d));
    let value = if diagnostics.is_empty() { value } else { None };
    (value, edges, diagnostics)
}

fn read<T>(tree: &Tree, env: &Env, build: impl Fn(TreeDeserializer<'_>) -> Result<T, Error>) -> (Option<T>, Vec<EdgeUse>, Vec<Diagnostic>) {
    let mut tree = tree.clone();
    let mut diagnostics = Vec::new();
    loop {
        let cx = Context { env, edges: RefCell::default(), path: RefCell::default() };
        let error = match build(TreeDeserializer { tree: &tree, cx: &cx }) {
            Ok(value) => return (Some(value), cx.edges.into_inner(), diagnostics),
            Err(error) => error,
        };
        let at = error.span;
        diagnostics.push(error.diagnostic(tree.span));
        // The field that holds the place is taken away for the next try.
        let Syntax::Struct(_, fields) = &mut tree.value else { return (None, Vec::new(), diagnostics) };
        let within = |outer: Span| at.is_some_and(|at| outer.start <= at.start && at.end <= outer.end && at != outer);
        let holds = |(key, value): &(Spanned<String>, Tree)| {
            within(key.span) || within(value.span) || at == Some(key.span) || at == Some(value.span)
        };
        match fields.iter().rposition(holds) {
            Some(i) => drop(fields.remove(i)),
            None => return (None, Vec::new(), diagnostics),
        }
    }
}

/// Names of the fields that must be an edge.
fn required_inputs(schema: &Schema) -> Vec<String> {
    let Some(properties) = schema.get("properties").and_then(|p| p.as_object()) else { return Vec::new() };
    let required = |p: &serde_json::Value| p.get("x-edge").is_some() && p.get("type").is_some_and(|t| t == "string");
    properties.iter().filter(|(_, p)| required(p)).map(|(name, _)| name.clone()).collect()
}

/// `minimum` and the like hold for every number of a field.
pub(crate) fn check_ranges(schema: &Schema, fields: &[(Spanned<String>, Tree)], env: &Env, diagnostics: &mut Vec<Diagnostic>) {
    let Some(properties) = schema.get("properties").and_then(|p| p.as_object()) else { return };
    for (key, value) in fields {
        let Some(property) = properties.get(&key.value) else { continue };
        let range = Range::of(property);
        if range.is_bounded() {
            range.check(&key.value, value, env, diagnostics);
        }
    }
}

/// The bounds of a property.
#[derive(Default)]
struct Range {
    min: Option<f64>,
    max: Option<f64>,
    above: Option<f64>,
    below: Option<f64>,
}

impl Range {
    fn of(property: &serde_json::Value) -> Self {
        let bound = |name: &str| {
            let own = property.get(name).and_then(serde_json::Value::as_f64);
            let of_items = property.get("items").and_then(|i| i.get(name)).and_then(serde_json::Value::as_f64);
            own.or(of_items)
        };
        Self { min: bound("minimum"), max: bound("maximum"), above: bound("exclusiveMinimum"), below: bound("exclusiveMaximum") }
    }

    fn is_bounded(&self) -> bool {
        self.min.is_some() || self.max.is_some() || self.above.is_some() || self.below.is_some()
    }

    fn check(&self, field: &str, tree: &Tree, env: &Env, diagnostics: &mut Vec<Diagnostic>) {
        let v = match &tree.value {
            Syntax::Integer(v) => *v as f64,
            Syntax::Float(v) => *v,
            // Mistakes in the expression are reported where it is read.
            Syntax::Text(text) => match text.strip_prefix('=').map(|e| Expr::parse(e).and_then(|e| e.eval(env))) {
                Some(Ok(v)) => v,
                _ => return,
            },
            Syntax::List(items) | Syntax::Tuple(None, items) => return items.iter().for_each(|t| self.check(field, t, env, diagnostics)),
            _ => return,
        };
        let wrong = self.min.is_some_and(|m| v < m)
            || self.max.is_some_and(|m| v > m)
            || self.above.is_some_and(|m| v <= m)
            || self.below.is_some_and(|m| v >= m);
        // A number that does not even fit its type is told already.
        if wrong && !diagnostics.iter().any(|d| d.span == tree.span) {
            let (low, high) = match (self.min, self.max) {
                (Some(a), Some(b)) => (Some(format!("{a} to {b}")), None),
                _ => (
                    self.min.map(|m| format!("at least {m}")).or(self.above.map(|m| format!("more than {m}"))),
                    self.max.map(|m| format!("at most {m}")).or(self.below.map(|m| format!("less than {m}"))),
                ),
            };
            let range: Vec<_> = low.into_iter().chain(high).collect();
            diagnostics.push(
                Diagnostic::error(tree.span, format!("`{field}` is {v}, out of its range")).label(format!("expected {}", range.join(", "))),
            );
        }
    }
}

/// Evaluates the expression in a text that begins with `=`.
fn evaluate(text: &str, span: Span, env: &Env) -> Result<f64, Error> {
    let result = Expr::parse(&text[1..]).and_then(|e| e.eval(env));
    result.map_err(|e| {
        // Behind the quote and the `=`, offsets agree when the string was written without escapes.
        let written = span.end - span.start == text.len() as u32 + 2;
        let start = span.start + 2;
        let place = Span { start: start + e.range.start as u32, end: start + e.range.end as u32, ..span };
        Error { message: e.message, label: "in this expression".into(), hint: e.hint, span: Some(if written { place } else { span }) }
    })
}

/// What a value is called in messages.
fn describe(value: &Syntax) -> String {
    match value {
        Syntax::Bool(b) => format!("`{b}`"),
        Syntax::Integer(v) => format!("the number {v}"),
        Syntax::Float(v) => format!("the number {v}"),
        Syntax::Text(t) if t.starts_with('=') => format!("the expression \"{t}\""),
        Syntax::Text(t) => format!("the text \"{t}\""),
        Syntax::None => "`None`".into(),
        Syntax::Tuple(Some(name), _) | Syntax::Struct(Some(name), _) => format!("`{}`", name.value),
        Syntax::Tuple(None, _) => "a tuple".into(),
        Syntax::Struct(None, _) => "a struct".into(),
        Syntax::List(_) => "a list".into(),
        Syntax::Map(_) => "a map".into(),
    }
}

impl<'a> TreeDeserializer<'a> {
    fn child(self, tree: &'a Tree) -> Self {
        Self { tree, cx: self.cx }
    }

    fn wrong(self, expected: &str) -> Error {
        Error::at(self.tree.span, format!("found {}", describe(&self.tree.value)), format!("expected {expected}"))
    }

    fn number(self) -> Result<f64, Error> {
        match &self.tree.value {
            Syntax::Integer(v) => Ok(*v as f64),
            Syntax::Float(v) if v.is_finite() => Ok(*v),
            Syntax::Text(text) if text.starts_with('=') => evaluate(text, self.tree.span, self.cx.env),
            Syntax::Float(_) => Err(self.wrong("a finite number")),
            _ => Err(self.wrong("a number")),
        }
    }

    /// A whole number; what an expression comes to is rounded down, so that `=in.width/2` serves odd widths too.
    fn integer(self) -> Result<i64, Error> {
        let span = self.tree.span;
        let computed = matches!(self.tree.value, Syntax::Text(_));
        let v = self.number()?;
        let nearest = v.round();
        let whole = (v - nearest).abs() <= 1e-9;
        if !(whole || computed) || nearest.abs() > 9e15 {
            return Err(Error::at(span, format!("{v} is no whole number"), "expected a whole number"));
        }
        Ok(if whole { nearest } else { v.floor() } as i64)
    }

    /// Notes the edge that a text names.
    fn edge(self, token: &str) -> Result<u64, Error> {
        let Syntax::Text(text) = &self.tree.value else {
            return Err(self.wrong("the name of a node or of a graph input, in quotes"));
        };
        if text.starts_with('=') {
            return Err(self.wrong("the name of a node or of a graph input, not an expression"));
        }
        let mut edges = self.cx.edges.borrow_mut();
        edges.push(EdgeUse {
            field: self.cx.path.borrow().join("."),
            kinds: kinds_of_token(token),
            text: text.clone(),
            span: self.tree.span,
        });
        Ok(edges.len() as u64 - 1)
    }

    /// Adds the place to an error that has none.
    fn place<T>(self, result: Result<T, Error>) -> Result<T, Error> {
        result.map_err(|mut e| {
            if e.span.is_none() {
                e.span = Some(self.tree.span);
                // serde says which Rust type it is; a user wants to know what he wrote.
                if e.message.starts_with("data did not match any variant of untagged enum") {
                    e.message = format!("found {}", describe(&self.tree.value));
                    e.label = "this field takes another kind of value".into();
                }
            }
            e
        })
    }
}

macro_rules! integers {
    ($($method:ident $visit:ident $ty:ty;)*) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
            let v = self.integer()?;
            let v = <$ty>::try_from(v).map_err(|_| {
                Error::at(self.tree.span, format!("{v} is out of range"), format!("expected {} to {}", <$ty>::MIN, <$ty>::MAX))
            })?;
            self.place(visitor.$visit(v))
        }
    )*};
}

impl<'de> de::Deserializer<'de> for TreeDeserializer<'_> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match &self.tree.value {
            Syntax::Bool(b) => self.place(visitor.visit_bool(*b)),
            Syntax::Integer(v) => match i64::try_from(*v) {
                Ok(v) if v < 0 => self.place(visitor.visit_i64(v)),
                Ok(v) => self.place(visitor.visit_u64(v as u64)),
                Err(_) => Err(self.wrong("a smaller number")),
            },
            Syntax::Float(v) if v.is_finite() => self.place(visitor.visit_f64(*v)),
            Syntax::Float(_) => Err(self.wrong("a finite number")),
            Syntax::Text(text) if text.starts_with('=') => {
                let v = evaluate(text, self.tree.span, self.cx.env)?;
                // Where any type will do, a whole number may be meant as one.
                if v.trunc() == v && (0.0..9e15).contains(&v) {
                    self.place(visitor.visit_u64(v as u64))
                } else {
                    self.place(visitor.visit_f64(v))
                }
            }
            Syntax::Text(text) => self.place(visitor.visit_str(text)),
            Syntax::None => self.place(visitor.visit_none()),
            // A bare name is a unit variant; serde's untagged enums take it as text.
            Syntax::Tuple(Some(name), values) if values.is_empty() => self.place(visitor.visit_str(&name.value)),
            Syntax::Tuple(None, values) | Syntax::List(values) => {
                self.place(visitor.visit_seq(Elements { d: self, values: values.iter() }))
            }
            Syntax::Tuple(Some(_), _) | Syntax::Struct(Some(_), _) => self.place(visitor.visit_enum(Variant { d: self })),
            Syntax::Struct(None, fields) => self.place(visitor.visit_map(Fields::new(self, fields))),
            Syntax::Map(entries) => self.place(visitor.visit_map(Entries { d: self, entries: entries.iter(), value: None })),
        }
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match &self.tree.value {
            Syntax::Bool(b) => visitor.visit_bool(*b),
            Syntax::Text(text) if text.starts_with('=') => visitor.visit_bool(evaluate(text, self.tree.span, self.cx.env)? != 0.0),
            _ => Err(self.wrong("`true` or `false`")),
        }
    }

    integers! {
        deserialize_i8 visit_i8 i8;
        deserialize_i16 visit_i16 i16;
        deserialize_i32 visit_i32 i32;
        deserialize_i64 visit_i64 i64;
        deserialize_u8 visit_u8 u8;
        deserialize_u16 visit_u16 u16;
        deserialize_u32 visit_u32 u32;
        deserialize_u64 visit_u64 u64;
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        let v = self.number()?;
        if v.abs() > f64::from(f32::MAX) {
            return Err(self.wrong("a number that 32 bits can hold"));
        }
        self.place(visitor.visit_f32(v as f32))
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        let v = self.number()?;
        self.place(visitor.visit_f64(v))
    }

    fn deserialize_char<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.deserialize_str(visitor)
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match &self.tree.value {
            Syntax::Text(text) => self.place(visitor.visit_str(text)),
            Syntax::Tuple(Some(name), values) if values.is_empty() => self.place(visitor.visit_str(&name.value)),
            _ => Err(self.wrong("a text in quotes")),
        }
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match &self.tree.value {
            Syntax::Text(text) => self.place(visitor.visit_str(text)),
            _ => Err(self.wrong("a text in quotes")),
        }
    }

    fn deserialize_bytes<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        Err(self.wrong("no bytes"))
    }

    fn deserialize_byte_buf<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        Err(self.wrong("no bytes"))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match &self.tree.value {
            Syntax::None => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_unit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_unit()
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_unit()
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, name: &'static str, visitor: V) -> Result<V::Value, Error> {
        if name.starts_with("$pipe::edge:") {
            return visitor.visit_u64(self.edge(name)?);
        }
        if name.starts_with("$pipe::edge_or_value:") {
            return match &self.tree.value {
                Syntax::Text(_) => visitor.visit_u64(self.edge(name)?),
                _ => visitor.visit_newtype_struct(self),
            };
        }
        if name == Driven::TOKEN || name == Operand::TOKEN {
            return match &self.tree.value {
                Syntax::Text(text) if !text.starts_with('=') => visitor.visit_u64(self.edge(name)?),
                // A field that also takes a bare name (`Otsu`) reads it by a visitor of its own.
                Syntax::Tuple(Some(bare), values) if values.is_empty() => {
                    visitor.visit_str(&bare.value).map_err(|_: Error| self.wrong("a number"))
                }
                _ => visitor.visit_f64(self.number()?),
            };
        }
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match &self.tree.value {
            Syntax::List(values) | Syntax::Tuple(_, values) => {
                let wanted = ExpectedText(&visitor).to_string();
                let elements = Elements { d: self, values: values.iter() };
                visitor.visit_seq(elements).map_err(|e| {
                    if e.span.is_none() { Error { label: format!("expected {wanted}"), span: Some(self.tree.span), ..e } } else { e }
                })
            }
            _ => Err(self.wrong("a list")),
        }
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, len: usize, visitor: V) -> Result<V::Value, Error> {
        match &self.tree.value {
            Syntax::List(values) | Syntax::Tuple(_, values) if values.len() != len => {
                Err(Error::at(self.tree.span, format!("found {} values", values.len()), format!("expected {len} values")))
            }
            Syntax::List(_) | Syntax::Tuple(..) => self.deserialize_seq(visitor),
            _ => Err(self.wrong(&format!("{len} values in parentheses"))),
        }
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(self, _: &'static str, len: usize, visitor: V) -> Result<V::Value, Error> {
        self.deserialize_tuple(len, visitor)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match &self.tree.value {
            Syntax::Map(entries) => self.place(visitor.visit_map(Entries { d: self, entries: entries.iter(), value: None })),
            Syntax::Struct(_, fields) => self.place(visitor.visit_map(Fields::new(self, fields))),
            _ => Err(self.wrong("a map such as `{\"name\": …}`")),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(self, _: &'static str, known: &'static [&'static str], visitor: V) -> Result<V::Value, Error> {
        let fields = match &self.tree.value {
            Syntax::Struct(_, fields) => fields.as_slice(),
            Syntax::Tuple(_, values) if values.is_empty() => &[],
            _ => return Err(self.wrong(&format!("fields in parentheses: {}", known.join(", ")))),
        };
        for (i, (key, _)) in fields.iter().enumerate() {
            if !known.contains(&key.value.as_str()) {
                let mut e = Error::at(key.span, format!("unknown field `{}`", key.value), format!("expected one of {}", known.join(", ")));
                e.hint = nearest(&key.value, known.iter().copied()).map(|n| format!("did you mean `{n}`?"));
                return Err(e);
            }
            if fields[..i].iter().any(|(other, _)| other.value == key.value) {
                return Err(Error::at(key.span, format!("`{}` is given twice", key.value), "remove one of them"));
            }
        }
        self.place(visitor.visit_map(Fields::new(self, fields)))
    }

    fn deserialize_enum<V: Visitor<'de>>(self, _: &'static str, known: &'static [&'static str], visitor: V) -> Result<V::Value, Error> {
        match &self.tree.value {
            Syntax::Tuple(Some(_), _) | Syntax::Struct(Some(_), _) => self.place(visitor.visit_enum(Variant { d: self })),
            Syntax::Text(text) if known.contains(&text.as_str()) => {
                let mut e = self.wrong(&format!("`{text}`"));
                e.hint = Some("a choice stands without quotes".into());
                Err(e)
            }
            _ => Err(self.wrong(&format!("one of {}", known.join(", ")))),
        }
    }

    fn deserialize_identifier<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.deserialize_str(visitor)
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_unit()
    }
}

struct ExpectedText<'v, V>(&'v V);

impl<'de, V: Visitor<'de>> fmt::Display for ExpectedText<'_, V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.expecting(f)
    }
}

struct Elements<'a> {
    d: TreeDeserializer<'a>,
    values: std::slice::Iter<'a, Tree>,
}

impl<'de> SeqAccess<'de> for Elements<'_> {
    type Error = Error;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Error> {
        self.values.next().map(|tree| seed.deserialize(self.d.child(tree))).transpose()
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.values.len())
    }
}

struct Fields<'a> {
    d: TreeDeserializer<'a>,
    fields: std::slice::Iter<'a, (Spanned<String>, Tree)>,
    value: Option<&'a (Spanned<String>, Tree)>,
}

impl<'a> Fields<'a> {
    fn new(d: TreeDeserializer<'a>, fields: &'a [(Spanned<String>, Tree)]) -> Self {
        Self { d, fields: fields.iter(), value: None }
    }
}

impl<'de> MapAccess<'de> for Fields<'_> {
    type Error = Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Error> {
        self.value = self.fields.next();
        self.value.map(|(key, _)| seed.deserialize(key.value.as_str().into_deserializer())).transpose()
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Error> {
        let (key, value) = self.value.expect("serde asks for a key before its value");
        self.d.cx.path.borrow_mut().push(key.value.clone());
        let child = self.d.child(value);
        let result = child.place(seed.deserialize(child));
        self.d.cx.path.borrow_mut().pop();
        result
    }
}

struct Entries<'a> {
    d: TreeDeserializer<'a>,
    entries: std::slice::Iter<'a, (Tree, Tree)>,
    value: Option<&'a (Tree, Tree)>,
}

impl<'de> MapAccess<'de> for Entries<'_> {
    type Error = Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Error> {
        self.value = self.entries.next();
        self.value.map(|(key, _)| seed.deserialize(self.d.child(key))).transpose()
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Error> {
        let (key, value) = self.value.expect("serde asks for a key before its value");
        let name = if let Syntax::Text(t) = &key.value { t.clone() } else { String::new() };
        self.d.cx.path.borrow_mut().push(name);
        let child = self.d.child(value);
        let result = child.place(seed.deserialize(child));
        self.d.cx.path.borrow_mut().pop();
        result
    }
}

struct Variant<'a> {
    d: TreeDeserializer<'a>,
}

impl<'de, 'a> EnumAccess<'de> for Variant<'a> {
    type Error = Error;
    type Variant = TreeDeserializer<'a>;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, TreeDeserializer<'a>), Error> {
        let (Syntax::Tuple(Some(name), _) | Syntax::Struct(Some(name), _)) = &self.d.tree.value else {
            return Err(self.d.wrong("a name"));
        };
        let variant = seed.deserialize(name.value.as_str().into_deserializer()).map_err(|mut e: Error| {
            e.span = Some(name.span);
            e
        })?;
        Ok((variant, self.d))
    }
}

impl<'de> VariantAccess<'de> for TreeDeserializer<'_> {
    type Error = Error;

    fn unit_variant(self) -> Result<(), Error> {
        match &self.tree.value {
            Syntax::Tuple(_, values) if values.is_empty() => Ok(()),
            Syntax::Tuple(Some(name), _) | Syntax::Struct(Some(name), _) => {
                let name = &name.value;
                Err(Error::at(self.tree.span, format!("`{name}` takes no values"), format!("expected `{name}`")))
            }
            _ => Err(self.wrong("a name")),
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Error> {
        match &self.tree.value {
            Syntax::Tuple(_, values) if values.len() == 1 => {
                let child = self.child(&values[0]);
                child.place(seed.deserialize(child))
            }
            // `Variant(field: …)` for a variant that wraps a struct, `Variant(a, b)` for one that wraps a tuple.
            Syntax::Struct(..) | Syntax::Tuple(..) => seed.deserialize(self),
            _ => Err(self.wrong("one value in parentheses")),
        }
    }

    fn tuple_variant<V: Visitor<'de>>(self, len: usize, visitor: V) -> Result<V::Value, Error> {
        de::Deserializer::deserialize_tuple(self, len, visitor)
    }

    /// The fields of a variant may also be given in their order: `Importance(5)` for `Importance(samples: 5)`.
    fn struct_variant<V: Visitor<'de>>(self, known: &'static [&'static str], visitor: V) -> Result<V::Value, Error> {
        match &self.tree.value {
            Syntax::Tuple(_, values) if values.len() > known.len() => {
                Err(Error::at(self.tree.span, format!("found {} values", values.len()), format!("expected {}", known.join(", "))))
            }
            Syntax::Tuple(_, values) if !values.is_empty() => {
                let read = visitor.visit_seq(Elements { d: self, values: values.iter() });
                // serde counts in Rust types when values are missing.
                read.map_err(|e| match e.span {
                    Some(_) => e,
                    None => Error::at(self.tree.span, format!("found {} values", values.len()), format!("expected {}", known.join(", "))),
                })
            }
            _ => de::Deserializer::deserialize_struct(self, "", known, visitor),
        }
    }
}
