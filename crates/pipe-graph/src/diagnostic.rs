//! Mistakes with their places: collected, sorted, and shown with the offending text underlined.
//!
//! No stage stops at the first mistake; each adds what it finds to [`Diagnostics`]. Rendering is
//! codespan-reporting's (naga uses it for shaders, so users see one style for both).

use std::path::{Path, PathBuf};

use codespan_reporting::diagnostic::{Diagnostic as Report, Label};
use codespan_reporting::files::{Files as _, SimpleFiles};
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

    /// Line and column of the first byte of a span, both from 1; columns count characters.
    pub fn place(&self, span: Span) -> (usize, usize) {
        let at = self.files.location(span.file.0 as usize, span.start as usize);
        at.map_or((1, 1), |at| (at.line_number, at.column_number))
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
        let config = Config { tab_width: 4, ..Config::default() };
        let mut out = String::new();
        for d in self.sorted() {
            let label = Label::primary(d.span.file.0 as usize, d.span.range()).with_message(&d.label);
            let report = match d.severity {
                Severity::Error => Report::error(),
                Severity::Warning => Report::warning(),
            };
            let notes = d.hint.iter().map(|h| format!("help: {h}")).collect();
            let report = report.with_message(&d.message).with_labels(vec![label]).with_notes(notes);
            let shown = if colour {
                let mut buffer = codespan_reporting::term::termcolor::Buffer::ansi();
                term::emit_to_write_style(&mut buffer, &config, &sources.files, &report)
                    .map(|()| String::from_utf8_lossy(buffer.as_slice()).into_owned())
            } else {
                term::emit_into_string(&config, &sources.files, &report)
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
}
