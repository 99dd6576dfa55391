//! The executor of `pipe`: runs a [`pipe_plan::Plan`] on wgpu. The only crate that names wgpu.

mod device;
mod error;
mod execute;
mod formats;
mod pipelines;
mod record;
mod storage;
mod transfer;

pub use device::{AdapterDescription, Choice, Device, enumerate};
pub use error::GpuError;
pub use execute::{Executor, Outputs, Prepared, RunOptions, Timings};
pub use formats::FormatSupport;
