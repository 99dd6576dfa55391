//! `VolumeShape`: solids with a soft surface.

use glam::{DVec2, DVec3};
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::resolution::{Resolution, centre};
use crate::shader;

/// A sphere, a torus or a box with a soft surface, in the middle of the unit cube. Its density is
/// clamp(0.5 − distance / softness, 0, 1), where the distance is negative inside: 0.5 on the surface. One channel.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct VolumeShape {
    /// Which solid.
    shape: Solid,
    /// Voxels along each edge, or [x, y, z].
    resolution: Resolution,
    /// Radius of the sphere, half the edge of the box, or radius of the torus's circle, whose tube is a third of that.
    #[default = 0.35]
    #[schemars(range(min = 0.0, max = 2.0), extend("x-unit" = "of the cube"))]
    size: f32,
    /// Distance over which the density falls from 1 to 0.
    #[default = 0.1]
    #[schemars(range(min = 0.0001, max = 10.0), extend("x-unit" = "of the cube"))]
    softness: f32,
}

/// Solids.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Solid {
    /// A ball.
    #[default]
    Sphere,
    /// A ring around the z axis.
    Torus,
    /// A cube.
    Box,
}

pub(super) const KIND: Kind = Kind::of::<VolumeShape>(
    "VolumeShape",
    Category::Volumes,
    &[
        r#"VolumeShape(shape: Sphere, resolution: 32)"#,
        r#"VolumeShape(shape: Torus, resolution: [31, 30, 17], size: 0.3, softness: 0.05)"#,
        r#"VolumeShape(shape: Box, resolution: 20, size: 0.25, softness: 0.3)"#,
    ],
);

impl Solid {
    /// Distance from the surface, negative inside.
    fn distance(self, p: DVec3, size: f64) -> f64 {
        match self {
            Self::Sphere => p.length() - size,
            Self::Torus => DVec2::new(p.truncate().length() - size, p.z).length() - size / 3.0,
            Self::Box => {
                let q = p.abs() - size;
                q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
            }
        }
    }
}

impl Node for VolumeShape {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(self.resolution.volume(1)?))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let out = cx.output("out");
        cx.pass("", shader!("volumes/volume_shape"))
            .write("out", out)
            .constant("SOLID", self.shape as i32)
            .param("size", self.size)
            .param("softness", self.softness)
            .add();
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        let size = self.resolution.size();
        vec![Tensor::Volume(Block::from_fn(size, 1, |x, y, z| {
            let distance = self.shape.distance(centre(size, [x, y, z]) - 0.5, self.size.into());
            [(0.5 - distance / f64::from(self.softness)).clamp(0.0, 1.0); 4]
        }))]
    }
}
