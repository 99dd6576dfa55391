//! The executor of `pipe`: runs a [`pipe_plan::plan::Plan`] on wgpu. The only crate that names wgpu.
//!
//! A [`Device`] is opened by [`Choice`]; an [`Executor`] owns it with everything worth keeping between runs
//! (pipelines, memory, staging buffers, histories). [`Executor::prepare`] makes all that one plan needs,
//! [`Executor::run`] uploads, launches and brings back, [`Executor::update`] takes over new parameters without
//! making anything. [`probe`] measures what a device can do.
//!
//! Nothing here decides: what runs, in which order, in which memory is the plan's business. What is decided here is
//! only how work is cut into submissions and how bytes cross between host and device.

mod adapter;
mod device;
mod error;
mod execute;
mod formats;
mod history;
mod memo;
mod patience;
mod pipelines;
mod prepare;
pub mod probe;
mod record;
mod stopwatch;
mod storage;
mod tiles;
mod transfer;

pub use adapter::{AdapterDescription, Choice, OpenOptions, enumerate, enumerate_with, hush_layers};
pub use device::Device;
pub use error::GpuError;
pub use execute::{Executor, Outputs, Part, RunOptions, Timings};
pub use formats::FormatSupport;
pub use prepare::Prepared;
pub use tiles::{Exchange, InMemory, Rows};
