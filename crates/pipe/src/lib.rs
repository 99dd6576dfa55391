//! `pipe`: a node-graph image pipeline processor on the GPU.
//!
//! The façade over the stages: [`project`] compiles a graph file, [`run`] takes pictures through it. The binary adds
//! only the command line. Read next: `ARCHITECTURE.md`.
//!
//! ```no_run
//! use pipe::project::{Project, World};
//! use pipe::run::{Job, Session};
//!
//! let mut job = Job::new("tone-map");
//! job.bind_input("in", "in.exr");
//! job.bind_output("out", "out.png")?;
//! let mut session = Session::open(&pipe_gpu::Choice::Best, None)?;
//! session.run(&job)?;
//! # Ok::<(), pipe::Failure>(())
//! ```

pub mod compare;
pub mod decode;
mod exchange;
mod failure;
mod forms;
pub mod frames;
pub mod plot;
pub mod presets;
pub mod project;
pub mod readback;
pub mod run;

pub use failure::Failure;
