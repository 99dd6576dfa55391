//! `Isosurface`: the surface where a volume reaches a density.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::bricks::{extremes, with_bricks};
use super::camera::{Camera, Ray};
use super::gradient::{lit, with_shading};
use crate::shader;

/// The surface where a volume reaches a density, lit by a point light. It is the first point of every eye ray where the density
/// is `iso` or more; its brightness is 0.5 + 0.5·n·l, n facing from high to low density by central differences over two
/// voxels, l towards the light. Transparent where there is none.
///
/// A density that is reached on a face of the unit cube shows that face: with `options: (border: Black)` normals there
/// point outwards, otherwise they follow the density inside. The first channel is the density.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Isosurface {
    /// The volume.
    volume: In<Volume>,
    /// The density of the surface.
    #[default(0.5.into())]
    iso: Driven,
    /// Where it is seen from.
    camera: Camera,
    /// Samples along a ray, evenly between the faces of the cube: details thinner than a step may be missed.
    #[default = 256]
    #[schemars(range(min = 1, max = 4096))]
    steps: u32,
    /// Place of the light, in the coordinates of the camera's `eye` and `target`.
    #[default([0.3, -2.0, 0.0])]
    light: [f32; 3],
    /// Whether the surface is searched between two samples, or is at the second one.
    #[default = true]
    refine: bool,
}

pub(super) const KIND: Kind = Kind::of::<Isosurface>(
    "Isosurface",
    Category::Volumes,
    &[
        r#"Isosurface(volume: "volume", camera: (size: (33, 25)))"#,
        r#"Isosurface(volume: "volume", iso: "scalar", camera: (eye: (2, 1.5, -1), size: (24, 24)), light: (3, 3, -3))"#,
        r#"Isosurface(volume: "volume", camera: (eye: (1.9, 0.9, 1.6), size: (25, 27), extent: (3, 1.5, 2)))"#,
        r#"Isosurface(volume: "fog", iso: 0.9, camera: (eye: (0.4, -1.2, 0.3), up: (0, 0, 1), size: (19, 23)), steps: 64, refine: false)"#,
    ],
)
.ports(&[
    ("out", "the lit surface"),
    ("depth", "distance from the eye along the ray; 0 where there is no surface"),
    ("normal", "x, y, z of the normal, alpha 1; all 0 where there is no surface"),
])
.tolerance(2e-4, 2e-4);

/// Halvings of the last step in search of the surface.
const HALVINGS: u32 = 16;

impl Isosurface {
    /// The distance at which the ray reaches the surface.
    fn hit(&self, ray: &Ray, density: impl Fn(f64) -> f64, iso: f64) -> Option<f64> {
        let [enter, leave] = ray.cube_span()?;
        let at = |i: u32| enter + (leave - enter) * f64::from(i) / f64::from(self.steps);
        let first = (0..=self.steps).find(|i| density(at(*i)) >= iso)?;
        if first == 0 || !self.refine {
            return Some(at(first));
        }
        let (mut outside, mut inside) = (at(first - 1), at(first));
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(outside, inside);
            if density(middle) >= iso {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        Some(inside)
    }
}

impl Node for Isosurface {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let (colour, depth) = (self.camera.image(4)?, self.camera.image(1)?);
        Ok(vec![Output::new("out", colour), Output::new("depth", depth), Output::new("normal", colour)])
    }

    fn makes_alpha(&self) -> bool {
        true
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (volume, border) = (cx.input(&self.volume), cx.border());
        let [out, depth, normal] = ["out", "depth", "normal"].map(|port| cx.output(port));
        let bricks = extremes(cx, volume, border, true);
        let pass = cx.pass("", with_bricks(&with_shading(&shader!("volumes/isosurface")))).entry(Entry::Each);
        self.camera
            .describe(pass)
            .read_with("volume", volume, Reach::Whole, border, Filter::Linear)
            .read_with("bricks", bricks, Reach::Whole, Border::Clamp, Filter::Nearest)
            .write("out", out)
            .write("depth", depth)
            .write("normal", normal)
            .driven("iso", &self.iso)
            .param("light", self.light)
            .param("steps", self.steps as i32)
            .constant("HALVINGS", if self.refine { HALVINGS as i32 } else { 0 })
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (volume, iso, view) = (cx.volume(&self.volume), cx.driven(&self.iso), self.camera.view());
        let surface = |ray: &Ray| {
            let hit = self.hit(ray, |t| volume.sample(ray.at(t).to_array(), cx.border)[0], iso)?;
            let (n, shade) = lit(volume, ray.at(hit), cx.border, &view, self.light);
            Some((hit * view.stretch(ray.direction), n, shade))
        };
        let (mut depth, mut normal) = (Vec::new(), Vec::new());
        let out = view.picture(4, |ray| {
            let hit = surface(&ray);
            depth.push(hit.map_or([0.0, 0.0, 0.0, 1.0], |(t, ..)| [t, t, t, 1.0]));
            normal.push(hit.map_or([0.0; 4], |(_, n, _)| [n.x, n.y, n.z, 1.0]));
            hit.map_or([0.0; 4], |(.., shade)| [shade, shade, shade, 1.0])
        });
        let depth = Raster { size: view.size, channels: 1, pixels: depth };
        let normal = Raster { size: view.size, channels: 4, pixels: normal };
        [out, depth, normal].map(Tensor::Image).into()
    }
}
