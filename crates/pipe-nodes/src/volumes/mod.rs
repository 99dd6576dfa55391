//! Scattering and volumes.

mod bricks;
pub(crate) mod camera;
mod cube_table;
mod dispatches;
mod gather_walk;
mod gradient;
mod isosurface;
mod light;
mod marching_cubes;
mod maximum_intensity;
mod medium;
mod phase;
mod photon_scatter;
mod photon_twin;
mod random;
pub(crate) mod resolution;
mod single_scatter;
mod volume_blur;
mod volume_gradient;
mod volume_noise;
mod volume_radiance;
mod volume_render;
mod volume_resample;
mod volume_shape;
mod volume_slice;

use pipe_graph::node::Kind;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[
    photon_scatter::KIND,
    single_scatter::KIND,
    gather_walk::KIND,
    volume_radiance::KIND,
    isosurface::KIND,
    volume_render::KIND,
    marching_cubes::KIND,
    maximum_intensity::KIND,
    volume_slice::KIND,
    volume_gradient::KIND,
    volume_blur::KIND,
    volume_resample::KIND,
    volume_noise::KIND,
    volume_shape::KIND,
];
