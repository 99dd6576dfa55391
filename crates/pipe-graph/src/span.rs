//! Places in source files, and the values of a RON file with their places.

use std::ops::Range;

/// Index of a file in [`Sources`](crate::diagnostic::Sources).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct FileId(pub u32);

/// A range of bytes in one file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Span {
    /// Which file.
    pub file: FileId,
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

impl Span {
    /// A span from byte offsets.
    pub fn new(file: FileId, range: Range<usize>) -> Self {
        Self { file, start: range.start as u32, end: range.end as u32 }
    }

    /// The byte range.
    pub const fn range(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// A value together with the place it was written at.
#[derive(Debug, Clone, PartialEq)]
pub struct Spanned<T> {
    /// Where.
    pub span: Span,
    /// What.
    pub value: T,
}

/// A RON value with the place of every part of it. Nothing is interpreted: a string stays a string, whether it
/// names an edge, holds an expression or is a path.
pub type Tree = Spanned<Syntax>;

/// What a RON value can be.
#[derive(Debug, Clone, PartialEq)]
pub enum Syntax {
    /// `true`, `false`
    Bool(bool),
    /// A number without a fraction or exponent.
    Integer(i128),
    /// Any other number.
    Float(f64),
    /// A string, unescaped.
    Text(String),
    /// `None`
    None,
    /// `Name`, `Name(…)` or `(…)` with positional values; no values for a bare name or `()`.
    Tuple(Option<Spanned<String>>, Vec<Tree>),
    /// `Name(field: value, …)` or `(field: value, …)`. Duplicate fields are kept for the checker to report.
    Struct(Option<Spanned<String>>, Vec<(Spanned<String>, Tree)>),
    /// `[…]`
    List(Vec<Tree>),
    /// `{ key: value, … }`
    Map(Vec<(Tree, Tree)>),
}
