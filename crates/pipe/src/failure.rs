//! Why the program could not do what was asked, and the exit code that says so.

use std::fmt;

/// What went wrong, in full sentences.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Failure {
    /// The graph or the command line is wrong: exit code 1.
    Graph(String),
    /// A file, the GPU, memory: exit code 2.
    World(String),
    /// Two things differ that should not (`compare`, `test`): exit code 1, already reported.
    Differs,
    /// The user interrupted: exit code 130.
    Interrupted,
}

impl Failure {
    /// The process's exit code.
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Graph(_) | Self::Differs => 1,
            Self::World(_) => 2,
            Self::Interrupted => 130,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // Rendered diagnostics say `error:` themselves.
            Self::Graph(text) if text.starts_with("error") || text.starts_with("warning") => f.write_str(text.trim_end()),
            Self::Graph(text) | Self::World(text) => write!(f, "error: {text}"),
            Self::Differs => Ok(()),
            Self::Interrupted => f.write_str("interrupted"),
        }
    }
}

impl std::error::Error for Failure {}

impl From<pipe_io::Error> for Failure {
    fn from(e: pipe_io::Error) -> Self {
        match e {
            pipe_io::Error::Argument { .. } | pipe_io::Error::Form { .. } | pipe_io::Error::UnknownExtension { .. } => {
                Self::Graph(e.to_string())
            }
            _ => Self::World(e.to_string()),
        }
    }
}

impl From<pipe_gpu::GpuError> for Failure {
    fn from(e: pipe_gpu::GpuError) -> Self {
        match e {
            pipe_gpu::GpuError::Interrupted => Self::Interrupted,
            _ => Self::World(e.to_string()),
        }
    }
}

impl From<pipe_plan::PlanError> for Failure {
    fn from(e: pipe_plan::PlanError) -> Self {
        match e {
            pipe_plan::PlanError::Node { .. } | pipe_plan::PlanError::Shader { .. } => Self::Graph(e.to_string()),
            _ => Self::World(e.to_string()),
        }
    }
}
