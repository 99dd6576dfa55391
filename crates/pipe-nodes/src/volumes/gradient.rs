//! The gradient of a volume between its voxels, and surfaces lit by it.

use glam::DVec3;
use pipe_graph::prelude::*;

use super::camera::View;
use crate::shader;

/// A shader with `density(p)` and `gradient(p)` of the port `volume` in scope.
pub(super) fn with_gradient(shader: &Shader) -> Shader {
    Shader::builtin(&shader.path, &format!("{}\n{}", shader.source, shader!("volumes/density").source))
}

/// A shader with `density(p)`, `normal_at(p)` and `lit(p, n)` of the port `volume` in scope; it has the parameters of a camera
/// and the place of a `light`.
pub(super) fn with_shading(shader: &Shader) -> Shader {
    let whole = with_gradient(shader);
    Shader::builtin(&shader.path, &format!("{}\n{}", whole.source, shader!("volumes/shading").source))
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

/// The direction that the surface through a point faces, as it is seen, and its brightness 0.5 + 0.5·n·l.
pub(super) fn lit(volume: &Block, p: DVec3, border: Border, view: &View, light: [f32; 3]) -> (DVec3, f64) {
    let n = facing(view.seen_gradient(gradient(volume, p, border)));
    let l = (DVec3::from(light.map(f64::from)) - view.seen_at(p)).normalize_or_zero();
    (n, 0.5 + 0.5 * n.dot(l))
}
