//! The gradient of a volume between its voxels, for viewers that shade surfaces.

use glam::DVec3;
use pipe_graph::prelude::*;

use crate::shader;

/// A shader with `density(p)` and `gradient(p)` of the port `volume` in scope.
pub(super) fn with_gradient(shader: &Shader) -> Shader {
    Shader::builtin(&shader.path, &format!("{}\n{}", shader.source, shader!("volumes/density").source))
}

/// Central differences over two voxels along each axis, in density per length of the unit cube, interpolated trilinearly.
pub(super) fn gradient(volume: &Block, p: DVec3, border: Border) -> DVec3 {
    std::array::from_fn(|axis| {
        let mut step = DVec3::ZERO;
        step[axis] = 1.0 / f64::from(volume.size[axis]);
        let value = |p: DVec3| volume.sample(p.to_array(), border)[0];
        (value(p + step) - value(p - step)) / (2.0 * step[axis])
    })
    .into()
}

/// The direction that a surface of this gradient faces; no direction where the density is constant.
pub(super) fn facing(gradient: DVec3) -> DVec3 {
    // Differences of interpolated equal values are rounding only.
    if gradient.length() < 1e-9 { DVec3::ZERO } else { -gradient.normalize() }
}
