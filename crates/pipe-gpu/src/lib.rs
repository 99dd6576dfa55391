//! The executor of pipe: the only crate that names wgpu.
