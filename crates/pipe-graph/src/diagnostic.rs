//! Mistakes with their places: collected, sorted, and shown with the offending text underlined.
//!
//! No stage stops at the first mistake; each adds what it finds to [`Diagnostics`]. Rendering is
//! codespan-reporting's (naga uses it for shaders, so users see one style for both).

use std::ops::Range;
use std::path::{Path, PathBuf};

use codespan_reporting::diagnostic::{Diagnostic as Report, Label};
use codespan_reporting::files::{self, Files, SimpleFiles};
use codespan_reporting::term::{self, Config};

use crate::span::{FileId, Span};

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Nothing can run.
    Error,
    /// It runs, but look at it.
    Warning,
}

/// One mistake, with the place and the next step.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// Error or warning.
    pub severity: Severity,
    /// Where; the offending text is underlined.
    pub span: Span,
    /// What is wrong, in one line.
    pub message: String,
    /// What stands under the underline: mostly what was expected.
    pub label: String,
    /// The next step, such as `did you mean `sigma`?`.
    pub hint: Option<String>,
}

impl Diagnostic {
    /// An error at a place.
    pub fn error(span: Span, message: impl Into<String>) -> Self {
        Self { severity: Severity::Error, span, message: message.into(), label: String::new(), hint: None }
    }

    /// A warning at a place.
    pub fn warning(span: Span, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(span, message) }
    }

    /// What stands under the underline.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = label.into();
        self
    }

    /// The next step.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// As a user reads it, with its place in these files.
    fn render<'f, F>(&self, files: &'f F, place: Range<usize>, colour: bool) -> Result<String, files::Error>
    where
        F: Files<'f, FileId = usize>,
    {
        let config = Config { tab_width: 4, ..Config::default() };
        let label = Label::primary(self.span.file.0 as usize, place).with_message(&self.label);
        let report = match self.severity {
            Severity::Error => Report::error(),
            Severity::Warning => Report::warning(),
        };
        let notes = self.hint.iter().map(|h| format!("help: {h}")).collect();
        let report = report.with_message(&self.message).with_labels(vec![label]).with_notes(notes);
        if colour {
            let mut buffer = term::termcolor::Buffer::ansi();
            term::emit_to_write_style(&mut buffer, &config, files, &report)?;
            Ok(String::from_utf8_lossy(buffer.as_slice()).into_owned())
        } else {
            term::emit_into_string(&config, files, &report)
        }
    }
}

/// The source files that places point into.
#[derive(Debug, Clone)]
pub struct Sources {
    files: SimpleFiles<String, String>,
    paths: Vec<PathBuf>,
}

impl Default for Sources {
    fn default() -> Self {
        Self { files: SimpleFiles::new(), paths: Vec::new() }
    }
}

impl Sources {
    /// Takes a file in.
    pub fn add(&mut self, path: &Path, text: &str) -> FileId {
        self.paths.push(path.to_owned());
        FileId(self.files.add(path.display().to_string(), text.to_owned()) as u32)
    }

    /// The path of a file.
    pub fn path(&self, file: FileId) -> &Path {
        &self.paths[file.0 as usize]
    }

    /// The part of a line that holds the beginning of a span, and where the span is in it; `None` where lines are short.
    fn excerpt(&self, span: Span) -> Option<(Excerpt, Range<usize>)> {
        let file = self.files.get(span.file.0 as usize).ok()?;
        let (text, place) = (file.source(), span.range());
        let line = |at: usize| file.line_range((), file.line_index((), at).ok()?).ok();
        let (first, last) = (line(place.start)?, line(place.end)?);
        if first.len().max(last.len()) <= LONGEST_LINE {
            return None;
        }
        let cut = |at: usize| (0..=at.min(first.end)).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
        let from = cut(place.start.saturating_sub(LONGEST_LINE / 4).max(first.start));
        let to = cut(place.start + LONGEST_LINE / 2);
        let ellipsis = |is_cut: bool| if is_cut { "…" } else { "" };
        let (before, after) = (ellipsis(from > first.start), ellipsis(to < first.end));
        let shown = text[from..to].trim_end_matches(['\n', '\r']);
        let (line, column) = self.place(span);
        let excerpt = Excerpt { name: file.name().clone(), text: format!("{before}{shown}{after}"), line, column };
        // What the span holds beyond the excerpt is not underlined.
        let inside = |at: usize| before.len() + (at - from).min(shown.len());
        Some((excerpt, inside(place.start)..inside(place.end)))
    }

    /// Line and column of the first byte of a span, both from 1; columns count characters.
    pub fn place(&self, span: Span) -> (usize, usize) {
        let at = self.files.location(span.file.0 as usize, span.start as usize);
        at.map_or((1, 1), |at| (at.line_number, at.column_number))
    }
}

/// Longest line that is shown whole, in bytes. A file may be one line, which would be printed once for each mistake.
const LONGEST_LINE: usize = 400;

/// A part of a line, in place of its file.
struct Excerpt {
    name: String,
    text: String,
    /// Where the place is in the file.
    line: usize,
    column: usize,
}

impl<'f> Files<'f> for Excerpt {
    type FileId = usize;
    type Name = &'f str;
    type Source = &'f str;

    fn name(&'f self, _: usize) -> Result<&'f str, files::Error> {
        Ok(&self.name)
    }

    fn source(&'f self, _: usize) -> Result<&'f str, files::Error> {
        Ok(&self.text)
    }

    fn line_index(&'f self, _: usize, _: usize) -> Result<usize, files::Error> {
        Ok(0)
    }

    fn line_number(&'f self, _: usize, _: usize) -> Result<usize, files::Error> {
        Ok(self.line)
    }

    fn column_number(&'f self, _: usize, _: usize, _: usize) -> Result<usize, files::Error> {
        Ok(self.column)
    }

    fn line_range(&'f self, _: usize, _: usize) -> Result<Range<usize>, files::Error> {
        Ok(0..self.text.len())
    }
}

/// The mistakes found so far.
#[derive(Debug, Clone, Default)]
pub struct Diagnostics {
    list: Vec<Diagnostic>,
}

impl Diagnostics {
    /// Adds one, unless it is there already (a subgraph used twice is wrong once).
    pub fn push(&mut self, diagnostic: Diagnostic) {
        if !self.list.contains(&diagnostic) {
            self.list.push(diagnostic);
        }
    }

    /// Adds several.
    pub fn extend(&mut self, diagnostics: impl IntoIterator<Item = Diagnostic>) {
        diagnostics.into_iter().for_each(|d| self.push(d));
    }

    /// Whether anything stands in the way of a run.
    pub fn has_errors(&self) -> bool {
        self.list.iter().any(|d| d.severity == Severity::Error)
    }

    /// Whether there is nothing to say.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// All of them, by file and place.
    pub fn sorted(&self) -> Vec<&Diagnostic> {
        let mut sorted: Vec<_> = self.list.iter().collect();
        sorted.sort_by_key(|d| (d.span.file, d.span.start, d.span.end, d.severity));
        sorted
    }

    /// All of them as a user reads them.
    pub fn render(&self, sources: &Sources, colour: bool) -> String {
        let mut out = String::new();
        for d in self.sorted() {
            let shown = match sources.excerpt(d.span) {
                Some((excerpt, place)) => d.render(&excerpt, place, colour),
                None => d.render(&sources.files, d.span.range(), colour),
            };
            // Rendering fails only on a span outside its file; the message still reaches the user.
            out.push_str(&shown.unwrap_or_else(|_| format!("error: {}\n", d.message)));
        }
        out
    }

    /// All of them as JSON objects: `{severity, file, line, column, message, label, hint}`.
    pub fn to_json(&self, sources: &Sources) -> serde_json::Value {
        let one = |d: &Diagnostic| {
            let (line, column) = sources.place(d.span);
            serde_json::json!({
                "severity": d.severity,
                "file": sources.path(d.span.file).display().to_string(),
                "line": line,
                "column": column,
                "message": d.message,
                "label": d.label,
                "hint": d.hint,
            })
        };
        self.sorted().into_iter().map(one).collect()
    }
}

/// The candidate that a misspelt name most likely meant.
pub fn nearest<'c>(name: &str, candidates: impl IntoIterator<Item = &'c str>) -> Option<&'c str> {
    let distance = |candidate: &str| {
        if candidate.eq_ignore_ascii_case(name) { 0 } else { strsim::damerau_levenshtein(candidate, name) }
    };
    let close = |c: &&str| {
        let longest = name.chars().count().max(c.chars().count());
        // Names that have no letter in common are not near, however short.
        distance(c) <= 1 + longest / 4 && distance(c) < longest
    };
    candidates.into_iter().filter(close).min_by_key(|c| (distance(c), *c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_names() {
        assert_eq!(nearest("sigmaa", ["sigma", "radius"]), Some("sigma"));
        assert_eq!(nearest("blurh", ["BlurV", "BlurH"]), Some("BlurH"));
        assert_eq!(nearest("zebra", ["sigma", "radius"]), None);
        assert_eq!(nearest("v", ["u"]), None);
    }

    #[test]
    fn shows_the_place_and_the_hint() {
        let mut sources = Sources::default();
        let file = sources.add(Path::new("a.ron"), "one\ntwo three\n");
        let mut all = Diagnostics::default();
        all.push(Diagnostic::error(Span::new(file, 8..13), "no such thing").label("expected four").hint("write four"));
        let text = all.render(&sources, false);
        assert!(text.contains("a.ron:2:5"), "{text}");
        assert!(text.contains("^^^^^ expected four"), "{text}");
        assert!(text.contains("help: write four"), "{text}");
    }
    /// A whole file in one line is not printed again for each of its mistakes.
    #[test]
    fn of_a_long_line_a_part_is_shown() {
        let mut sources = Sources::default();
        let line = format!("{}three{}", "αβ ".repeat(1000), " four".repeat(1000));
        let file = sources.add(Path::new("a.ron"), &format!("one\n{line}\nfive"));
        let start = 4 + 5 * 1000;
        for (end, underlined) in [(start + 5, "^^^^^ expected four\n"), (start + 5000, "^ expected four\n"), (start, "^ expected four\n")] {
            let mut all = Diagnostics::default();
            all.push(Diagnostic::error(Span::new(file, start..end), "no such thing").label("expected four"));
            let text = all.render(&sources, false);
            assert!(text.contains("a.ron:2:3001"), "{text}");
            assert!(text.contains("2 │ …") && text.contains(" αβ three four") && text.contains(underlined), "{text}");
            assert!(text.len() < 2000, "{text}");
        }
    }
}
