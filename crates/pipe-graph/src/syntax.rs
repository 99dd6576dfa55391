//! Text → [`Tree`]: RON with the place of every part.
//!
//! The grammar is the `ron` crate's. What it does not keep is where a value stood, so each level is read as
//! borrowed [`RawValue`]s, whose addresses inside the text are the places; then each of them is read the same way.
//! Every level is scanned once more by its parent, so nesting is bounded. A parser of our own would be faster and
//! would drift from RON.

use std::fmt;

use ron::Options;
use ron::extensions::Extensions;
use ron::value::RawValue;
use serde::de::{Deserializer as _, MapAccess, SeqAccess, Visitor};

use crate::diagnostic::Diagnostic;
use crate::span::{FileId, Span, Spanned, Syntax, Tree};

/// Deepest nesting of values in one file.
const MOST_DEPTH: usize = 48;

/// Largest graph file.
pub const MOST_BYTES: usize = 1 << 20;

/// Parses a text that is one RON value.
pub fn parse_tree(text: &str, file: FileId) -> Result<Tree, Diagnostic> {
    if text.len() > MOST_BYTES {
        return Err(Diagnostic::error(Span::new(file, 0..0), "the file is too large")
            .label(format!("expected at most {MOST_BYTES} bytes"))
            .hint("move parts of it into subgraphs"));
    }
    let reader = Reader { text, file };
    let raw = options().from_str::<&RawValue>(text).map_err(|e| reader.syntax_error(&e))?;
    reader.tree(raw, 0)
}

fn options() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME).with_recursion_limit(2 * MOST_DEPTH)
}

struct Reader<'t> {
    text: &'t str,
    file: FileId,
}

impl<'t> Reader<'t> {
    fn syntax_error(&self, error: &ron::error::SpannedError) -> Diagnostic {
        let at = |p: ron::error::Position| {
            let line_start = self.text.split_inclusive('\n').take(p.line.saturating_sub(1)).map(str::len).sum::<usize>();
            let line = &self.text[line_start..];
            line_start + line.char_indices().nth(p.col.saturating_sub(1)).map_or(line.len(), |(i, _)| i)
        };
        let (message, label, hint) = told(&error.code);
        let mut start = at(error.span.start).min(self.text.len());
        if let Some(open) = self.open_string(start) {
            return Diagnostic::error(self.in_line(open, usize::MAX), "this string is not closed in its line")
                .label("expected `\"` at its end");
        }
        // ron means the next sign, and stands before the space in front of it.
        start += self.text[start..].len() - self.text[start..].trim_start().len();
        let end = match error.code {
            _ if start >= self.text.trim_end().len() => {
                start = self.text.trim_end().len();
                start
            }
            ron::Error::ExpectedFloat | ron::Error::ExpectedInteger => {
                let token = |c: char| c.is_alphanumeric() || matches!(c, '.' | '+' | '-' | '_');
                start + self.text[start..].find(|c| !token(c)).unwrap_or(1)
            }
            _ => at(error.span.end),
        };
        let d = Diagnostic::error(self.in_line(start, end), message).label(label);
        match hint {
            Some(hint) => d.hint(hint),
            None => d,
        }
    }

    /// From a place to another or to the end of its line, at least one character.
    fn in_line(&self, start: usize, end: usize) -> Span {
        let rest = &self.text[start..];
        let line = start + rest.find(['\n', '\r']).unwrap_or(rest.len());
        let one = start + rest.chars().next().map_or(0, char::len_utf8);
        Span::new(self.file, start..end.min(line).max(one).min(self.text.len()))
    }

    /// Where a string begins that ends right before this place, lines further down: nobody meant that.
    fn open_string(&self, end: usize) -> Option<usize> {
        let before = self.text[..end].strip_suffix('"')?;
        let start = before.rfind('"')?;
        before[start..].contains('\n').then_some(start)
    }

    /// The place of a part of the text.
    fn span(&self, part: &str) -> Span {
        let start = part.as_ptr() as usize - self.text.as_ptr() as usize;
        Span::new(self.file, start..start + part.len())
    }

    fn tree(&self, raw: &'t RawValue, depth: usize) -> Result<Tree, Diagnostic> {
        self.value(raw.trim().get_ron(), depth)
    }

    fn value(&self, text: &'t str, depth: usize) -> Result<Tree, Diagnostic> {
        let span = self.span(text);
        if depth > MOST_DEPTH {
            return Err(Diagnostic::error(span, "values are nested too deep").label(format!("expected at most {MOST_DEPTH} levels")));
        }
        let fail = |what: &str| Diagnostic::error(span, format!("this is no {what}")).label("here");
        let first = text.chars().next().unwrap_or(' ');
        let name_end = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
        let value = match first {
            '"' => Syntax::Text(options().from_str(text).map_err(|_| fail("string"))?),
            'r' if text[1..].starts_with(['"', '#']) && text.contains('"') => {
                Syntax::Text(options().from_str(text).map_err(|_| fail("string"))?)
            }
            '\'' => Syntax::Text(options().from_str::<char>(text).map_err(|_| fail("character"))?.to_string()),
            '[' => Syntax::List(self.all(self.parts(text, false)?.values, depth)?),
            '{' => {
                let parts = self.parts(text, true)?;
                let keys = self.all(parts.map_keys, depth)?;
                Syntax::Map(keys.into_iter().zip(self.all(parts.values, depth)?).collect())
            }
            '(' => self.call(None, text, depth)?,
            '+' | '-' | '.' | '0'..='9' => number(text).ok_or_else(|| fail("number"))?,
            _ if name_end == 0 => return Err(fail("value")),
            _ => match &text[..name_end] {
                "true" => Syntax::Bool(true),
                "false" => Syntax::Bool(false),
                "None" => Syntax::None,
                "inf" | "NaN" => number(text).ok_or_else(|| fail("number"))?,
                "Some" => {
                    let inner: Option<&RawValue> = options().from_str(text).map_err(|_| fail("optional value"))?;
                    return inner.map_or_else(|| Err(fail("optional value")), |raw| self.tree(raw, depth + 1));
                }
                name => {
                    let name = Spanned { span: self.span(name), value: name.to_owned() };
                    match text.find('(') {
                        Some(open) => self.call(Some(name), &text[open..], depth)?,
                        None => Syntax::Tuple(Some(name), Vec::new()),
                    }
                }
            },
        };
        Ok(Tree { span, value })
    }

    /// `(…)` behind an optional name.
    fn call(&self, name: Option<Spanned<String>>, text: &'t str, depth: usize) -> Result<Syntax, Diagnostic> {
        let parts = self.parts(text, false)?;
        let values = self.all(parts.values, depth)?;
        Ok(match parts.fields {
            Some(fields) => {
                let fields = fields.into_iter().map(|f| Spanned { span: self.span(f), value: f.to_owned() });
                Syntax::Struct(name, fields.zip(values).collect())
            }
            None => Syntax::Tuple(name, values),
        })
    }

    fn all(&self, raw: Vec<&'t RawValue>, depth: usize) -> Result<Vec<Tree>, Diagnostic> {
        raw.into_iter().map(|r| self.tree(r, depth + 1)).collect()
    }

    fn parts(&self, text: &'t str, map: bool) -> Result<Parts<'t>, Diagnostic> {
        let options = options();
        let whole = self.span(text);
        let fail = |e: ron::Error| Diagnostic::error(whole, lower_first(&e.to_string())).label("here");
        let mut ron = ron::Deserializer::from_str_with_options(text, &options).map_err(|e| fail(e.code))?;
        ron.deserialize_any(PartsVisitor { map }).map_err(fail)
    }
}

/// What a syntax error is called, what was expected, and the next step.
fn told(code: &ron::Error) -> (String, String, Option<String>) {
    use ron::Error as E;
    let say = |message: &str, label: &str, hint: Option<&str>| (message.to_owned(), label.to_owned(), hint.map(str::to_owned));
    match code {
        E::Eof => say("the file ends too early", "something is missing here", Some("is every bracket closed?")),
        E::ExpectedComma => say(
            "the value before this has ended",
            "expected a comma or the closing bracket",
            Some("a comma stands between values, a colon between a name and its value"),
        ),
        E::ExpectedIdentifier => say("this is no name of a field", "expected a name or `)`", Some("is every bracket closed?")),
        E::ExpectedMapColon | E::ExpectedNamedStructLike(_) => say("a name needs a value", "expected `:`", None),
        E::ExpectedFloat | E::ExpectedInteger => say("this is no number", "expected a number", None),
        E::UnexpectedChar(c) => (format!("`{c}` does not fit here"), "expected a value".into(), None),
        E::InvalidEscape(_) => say(
            "there is no such escape",
            "expected `\\n`, `\\t`, `\\\"` or `\\\\`",
            Some("a backslash is written twice; paths may be written with `/`"),
        ),
        E::TrailingCharacters => say("the graph has ended", "expected the end of the file", Some("all sections stand inside `Graph(…)`")),
        E::UnclosedBlockComment => say("this comment is not closed", "expected `*/` behind it", None),
        E::ExceededRecursionLimit => ("values are nested too deep".into(), format!("expected at most {MOST_DEPTH} levels"), None),
        other => (lower_first(&other.to_string()), "here".into(), None),
    }
}

fn lower_first(message: &str) -> String {
    let mut chars = message.chars();
    chars.next().map(|c| c.to_lowercase().chain(chars).collect()).unwrap_or_default()
}

fn number(text: &str) -> Option<Syntax> {
    if let Ok(integer) = ron::from_str::<i64>(text) {
        return Some(Syntax::Integer(integer.into()));
    }
    ron::from_str::<f64>(text).ok().map(Syntax::Float)
}

/// What stands between brackets.
#[derive(Default)]
struct Parts<'t> {
    /// Field names of a struct.
    fields: Option<Vec<&'t str>>,
    /// Keys of a map.
    map_keys: Vec<&'t RawValue>,
    values: Vec<&'t RawValue>,
}

struct PartsVisitor {
    map: bool,
}

impl<'t> Visitor<'t> for PartsVisitor {
    type Value = Parts<'t>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list, a map or a struct")
    }

    fn visit_unit<E>(self) -> Result<Parts<'t>, E> {
        Ok(Parts::default())
    }

    fn visit_seq<A: SeqAccess<'t>>(self, mut seq: A) -> Result<Parts<'t>, A::Error> {
        let mut parts = Parts::default();
        while let Some(value) = seq.next_element()? {
            parts.values.push(value);
        }
        Ok(parts)
    }

    fn visit_map<A: MapAccess<'t>>(self, mut map: A) -> Result<Parts<'t>, A::Error> {
        let mut parts = Parts::default();
        if self.map {
            while let Some((key, value)) = map.next_entry()? {
                parts.map_keys.push(key);
                parts.values.push(value);
            }
        } else {
            let mut fields = Vec::new();
            while let Some((key, value)) = map.next_entry()? {
                fields.push(key);
                parts.values.push(value);
            }
            parts.fields = Some(fields);
        }
        Ok(parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Tree {
        parse_tree(text, FileId(0)).expect("parses")
    }

    #[test]
    fn every_part_has_its_place() {
        let text =
            "Graph(\n  // a comment\n  nodes: { \"a\": Blur(image: \"in\", sigma: 2.5), }, on: true, list: [1, -2.0], t: (1, 2), k: Auto)";
        let tree = parse(text);
        let Syntax::Struct(Some(head), fields) = &tree.value else { panic!("{tree:?}") };
        assert_eq!(head.value, "Graph");
        assert_eq!(&text[fields[0].0.span.range()], "nodes");
        let Syntax::Map(nodes) = &fields[0].1.value else { panic!() };
        assert_eq!(&text[nodes[0].0.span.range()], "\"a\"");
        let Syntax::Struct(Some(kind), blur) = &nodes[0].1.value else { panic!() };
        assert_eq!(&text[kind.span.range()], "Blur");
        assert_eq!(&text[blur[1].1.span.range()], "2.5");
        assert_eq!(fields[1].1.value, Syntax::Bool(true));
        let Syntax::List(list) = &fields[2].1.value else { panic!() };
        assert_eq!(list[1].value, Syntax::Float(-2.0));
        assert!(matches!(&fields[3].1.value, Syntax::Tuple(None, v) if v.len() == 2));
        assert!(matches!(&fields[4].1.value, Syntax::Tuple(Some(n), v) if n.value == "Auto" && v.is_empty()));
    }

    #[test]
    fn duplicates_are_kept() {
        let Syntax::Struct(_, fields) = parse("(a: 1, a: 2)").value else { panic!() };
        assert_eq!(fields.len(), 2);
    }

    #[test]
    fn syntax_errors_have_a_place() {
        let d = parse_tree("Graph(\n  version: 1,\n  nodes: {,\n)", FileId(0)).expect_err("broken");
        assert_eq!(d.span.start, 31, "{d:?}");
    }

    #[test]
    fn deep_nesting_is_an_error() {
        for n in [60, 5000] {
            let text = "[".repeat(n) + &"]".repeat(n);
            assert!(parse_tree(&text, FileId(0)).is_err());
        }
    }
}
