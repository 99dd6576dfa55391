//! Mistakes with their places.

use crate::span::Span;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
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
