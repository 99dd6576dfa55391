//! What can go wrong between a file and host memory.
//!
//! One enum for the whole crate: each variant names the file, says what is wrong and what to do next. Codecs do not
//! know which file they read, so inside the crate they raise a [`Fault`], and the one place that knows the file turns
//! it into an [`Error`]. The reason stays a sentence rather than a nested error type: no caller can do more with
//! "invalid Huffman table" than print it, and the codec crates' own error types would become part of our interface.

use std::{fmt, io};

use thiserror::Error;

use crate::source::Format;

/// The result of everything in this crate that touches a file.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why a file could not be read, written or named. The text is complete: it needs no chain of causes printed after it.
#[derive(Debug, Error)]
pub enum Error {
    /// The operating system refused to open or read the file.
    #[error("cannot read `{file}`: {source}; check that it exists and that you may read it")]
    Read {
        /// The file as the user named it.
        file: String,
        /// What the operating system said.
        source: io::Error,
    },
    /// The operating system refused to create, write or rename the file. The old file, if any, is untouched.
    #[error("cannot write `{file}`: {source}; {advice}")]
    Write {
        /// The file as the user named it.
        file: String,
        /// What the operating system said.
        source: io::Error,
        /// What to do about it.
        advice: &'static str,
    },
    /// The first bytes belong to no format this crate reads.
    #[error("`{file}` is no {what} this program knows: its first bytes match none of {known}; convert it to one of these")]
    UnknownFormat {
        /// The file as the user named it.
        file: String,
        /// What it should have been: an image, a volume.
        what: &'static str,
        /// The formats that are known.
        known: String,
    },
    /// The extension names no format this crate writes.
    #[error("cannot tell the format of `{file}` from its name; end it in one of {known}")]
    UnknownExtension {
        /// The file as the user named it.
        file: String,
        /// The extensions that are known.
        known: String,
    },
    /// The bytes break the rules of their format.
    #[error("`{file}` is not a valid {format} file: {reason}; copy or export it again")]
    Damaged {
        /// The file as the user named it.
        file: String,
        /// The format it claims to be.
        format: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// The bytes are (probably) fine, but use something this crate does not read.
    #[error("`{file}` uses a feature of {format} that is not supported: {reason}")]
    Unsupported {
        /// The file as the user named it.
        file: String,
        /// The format it is.
        format: &'static str,
        /// Which feature, and what to do instead.
        reason: String,
    },
    /// The header declares more than the limits allow.
    #[error("`{file}` is too large: {reason}; {advice}")]
    TooLarge {
        /// The file as the user named it.
        file: String,
        /// What is declared and what is allowed.
        reason: String,
        /// What to do about it.
        advice: &'static str,
    },
    /// No layer or part has the name after the `#`.
    #[error("`{file}` has no layer `{wanted}`; it has: {available}")]
    NoSuchLayer {
        /// The file as the user named it.
        file: String,
        /// The name asked for.
        wanted: String,
        /// The names to choose from.
        available: String,
    },
    /// The format cannot hold what was asked for, or the picture is not in the form it was asked for.
    #[error("cannot write `{file}`: {reason}")]
    Form {
        /// The file as the user named it.
        file: String,
        /// What does not fit, and what would.
        reason: String,
    },
    /// A word or pattern of the command line means nothing.
    #[error("`{text}` is not {expected}")]
    Argument {
        /// What was typed.
        text: String,
        /// What would have been understood.
        expected: String,
    },
}

impl Error {
    /// An [`Error::Read`] of `file`.
    #[allow(clippy::needless_pass_by_value)] // called with temporaries throughout
    pub(crate) fn read(file: impl fmt::Display, source: io::Error) -> Self {
        Self::Read { file: file.to_string(), source }
    }

    /// An [`Error::Write`] of `file`, with advice chosen by the kind of failure.
    #[allow(clippy::needless_pass_by_value)] // called with temporaries throughout
    pub(crate) fn write(file: impl fmt::Display, source: io::Error) -> Self {
        let advice = match source.kind() {
            io::ErrorKind::NotFound => "create its folder first",
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => "choose a folder in which you may create files",
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "free some space",
            io::ErrorKind::IsADirectory => "name a file, not a folder",
            _ => "an earlier file of that name is untouched",
        };
        Self::Write { file: file.to_string(), source, advice }
    }

    /// An [`Error::Argument`].
    pub(crate) fn argument(text: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Argument { text: text.into(), expected: expected.into() }
    }

    /// Whether this is a broken pipe on a stream: the reader of our output went away, which is no failure.
    pub fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Write { source, .. } if source.kind() == io::ErrorKind::BrokenPipe)
    }
}

/// What to do about a file that is too large.
pub(crate) const RAISE: &str = "raise the limit if this is meant";
pub(crate) const BY_ROWS: &str = "read it by bands of rows, or raise the limit if this is meant";
const NOT_BY_ROWS: &str = "convert it to EXR, PNG or TIFF, which are read by bands of rows, or raise the limit if this is meant";

/// What a codec has to say; it becomes an [`Error`] where the file's name is known.
#[derive(Debug)]
pub(crate) enum Fault {
    Damaged(String),
    Unsupported(String),
    TooLarge(String),
    NoSuchLayer {
        wanted: String,
        available: String,
    },
    Form(String),
    /// Reading failed.
    Read(io::Error),
    /// Writing failed.
    Io(io::Error),
}

impl Fault {
    #[allow(clippy::needless_pass_by_value)] // called with temporaries throughout
    pub(crate) fn damaged(reason: impl fmt::Display) -> Self {
        Self::Damaged(reason.to_string())
    }

    #[allow(clippy::needless_pass_by_value)] // called with temporaries throughout
    pub(crate) fn unsupported(reason: impl fmt::Display) -> Self {
        Self::Unsupported(reason.to_string())
    }

    /// A failure to read, which is damage where the file ends too early.
    pub(crate) fn reading(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::UnexpectedEof => Self::damaged("it ends too early"),
            _ => Self::Read(error),
        }
    }

    /// Names the file and the format of its image.
    pub(crate) fn of(self, file: impl fmt::Display, format: Format) -> Error {
        match self {
            Self::TooLarge(reason) if format.by_rows() => Error::TooLarge { file: file.to_string(), reason, advice: BY_ROWS },
            Self::TooLarge(reason) => Error::TooLarge { file: file.to_string(), reason, advice: NOT_BY_ROWS },
            other => other.named(file, format.name()),
        }
    }

    /// Names the file and its format.
    #[allow(clippy::needless_pass_by_value)] // called with temporaries throughout
    pub(crate) fn named(self, file: impl fmt::Display, format: &'static str) -> Error {
        let file = file.to_string();
        match self {
            Self::Damaged(reason) => Error::Damaged { file, format, reason },
            Self::Unsupported(reason) => Error::Unsupported { file, format, reason },
            Self::TooLarge(reason) => Error::TooLarge { file, reason, advice: RAISE },
            Self::NoSuchLayer { wanted, available } => Error::NoSuchLayer { file, wanted, available },
            Self::Form(reason) => Error::Form { file, reason },
            Self::Read(source) => Error::read(file, source),
            Self::Io(source) => Error::write(file, source),
        }
    }
}
