//! Scattering and volumes.

pub(crate) mod camera;
mod light;
mod maximum_intensity;
mod medium;
mod phase;
mod photon_scatter;
mod photon_twin;
mod random;
pub(crate) mod resolution;
mod volume_noise;
mod volume_shape;
mod volume_slice;

use pipe_graph::node::Kind;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] =
    &[photon_scatter::KIND, maximum_intensity::KIND, volume_slice::KIND, volume_noise::KIND, volume_shape::KIND];
