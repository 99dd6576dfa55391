//! Scattering and volumes.

pub(crate) mod camera;
mod maximum_intensity;
pub(crate) mod resolution;
mod volume_noise;
mod volume_shape;
mod volume_slice;

use pipe_graph::node::Kind;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[maximum_intensity::KIND, volume_slice::KIND, volume_noise::KIND, volume_shape::KIND];
