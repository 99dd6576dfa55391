//! `VolumeRender`: a volume as a coloured, translucent body.

use glam::DVec3;
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::bricks::{extremes, with_bricks};
use super::camera::{Camera, Ray, View};
use super::gradient::{lit, with_shading};
use crate::shader;

/// A volume as a coloured, translucent body: samples along every eye ray are composited. See R. Drebin, L. Carpenter and
/// P. Hanrahan, Volume Rendering, 1988.
///
/// A sample of density d has the opacity α = clamp(e·(d − c) + 0.5, 0, 1) and, with `transfer: Lecture`, the colour
/// (0.5 + 0.5·n·l)·(d, d², d³) + 0.1, n facing from high to low density by central differences over two voxels, l towards
/// the light. α is meant for 256 steps across the diagonal of the unit cube; for a path of another length s, in such steps,
/// it is 1 − (1 − α)^s, so that the number of steps changes the quality and not the picture. The first channel is the density.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct VolumeRender {
    /// The volume.
    volume: In<Volume>,
    /// Slope of the opacity, e.
    #[default = 1.0]
    alpha_exponent: f32,
    /// Density of opacity 0.5, c.
    #[default = 0.5]
    alpha_center: f32,
    /// Which samples come first. `FrontToBack` ends a ray where less than 1e-4 of its light would pass.
    order: Order,
    /// Samples across the diagonal of the cube.
    #[default = 256]
    #[schemars(range(min = 1, max = 4096))]
    steps: u32,
    /// Where it is seen from.
    camera: Camera,
    /// `Lecture`, or a table of red, green, blue and α, again and again, for evenly spaced densities from 0 to 1; between
    /// them it is interpolated, and its colours are not lit.
    #[default(EdgeOr::Value(Transfer::Lecture))]
    transfer: EdgeOr<Table, Transfer>,
    /// Place of the light, in the coordinates of the camera's `eye` and `target`.
    #[default([0.3, -2.0, 0.0])]
    light: [f32; 3],
}

/// Orders of compositing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Order {
    /// From the eye, ending early.
    #[default]
    FrontToBack,
    /// Towards the eye.
    BackToFront,
}

/// Transfer functions that need no table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Transfer {
    /// Lit, (d, d², d³).
    Lecture,
}

pub(super) const KIND: Kind = Kind::of::<VolumeRender>(
    "VolumeRender",
    Category::Volumes,
    &[
        r#"VolumeRender(volume: "volume", camera: (size: (33, 25)))"#,
        r#"VolumeRender(volume: "volume", alpha_exponent: 0.3, alpha_center: 2, camera: (eye: (2, 1.5, -1), size: (24, 24)), steps: 100)"#,
        r#"VolumeRender(volume: "fog", order: BackToFront, alpha_exponent: 0.2, alpha_center: 2.5, camera: (eye: (0.4, -1.2, 0.3), up: (0, 0, 1), size: (19, 23)))"#,
        r#"VolumeRender(volume: "volume", transfer: Lecture, order: BackToFront, light: (2, 2, 2), camera: (eye: (0.5, 0.6, 0.4), size: (19, 23)), steps: 33)"#,
        r#"VolumeRender(volume: "volume", alpha_exponent: 0.3, alpha_center: 2, camera: (eye: (1.9, 0.9, 1.6), size: (25, 27), extent: (3, 1.5, 2)))"#,
        r#"VolumeRender(volume: "volume", transfer: "curve", camera: (eye: (2, 1.5, -1), size: (24, 24)))"#,
    ],
)
.tolerance(2e-4, 1e-4);

/// The step that opacities are meant for, in lengths of the cube.
const REFERENCE_STEP: f64 = 1.7320508075688772 / 256.0;

impl VolumeRender {
    fn step(&self) -> f64 {
        3.0_f64.sqrt() / f64::from(self.steps)
    }

    /// Colour and opacity of a reference step, by the formula.
    fn lecture(&self, volume: &Block, p: DVec3, border: Border, view: &View) -> (DVec3, f64) {
        let d = volume.sample(p.to_array(), border)[0];
        let alpha = (f64::from(self.alpha_exponent) * (d - f64::from(self.alpha_center)) + 0.5).clamp(0.0, 1.0);
        let (_, lit) = lit(volume, p, border, view, self.light);
        (lit * DVec3::new(d, d * d, d * d * d) + 0.1, alpha)
    }

    /// The picture's pixel, back to front, which needs no early end.
    fn composite(&self, ray: &Ray, stretch: f64, sample: impl Fn(DVec3) -> (DVec3, f64)) -> [f64; 4] {
        let Some([enter, leave]) = ray.cube_span() else { return [0.0; 4] };
        let (mut colour, mut opacity, step) = (DVec3::ZERO, 0.0, self.step() / stretch);
        for i in (0..((leave - enter) / step).ceil() as u32).rev() {
            let near = enter + f64::from(i) * step;
            let length = step.min(leave - near);
            let (c, alpha) = sample(ray.at(near + length / 2.0));
            let alpha = 1.0 - (1.0 - alpha).powf(length * stretch / REFERENCE_STEP);
            colour = alpha * c + (1.0 - alpha) * colour;
            opacity = alpha + (1.0 - alpha) * opacity;
        }
        [colour.x, colour.y, colour.z, opacity]
    }
}

/// Colour and opacity of a density by a table.
fn look_up(table: &[f64], d: f64) -> (DVec3, f64) {
    let entries = table.len() / 4;
    let place = d.clamp(0.0, 1.0) * (entries - 1) as f64;
    let first = (place.floor() as usize).min(entries.saturating_sub(2));
    let fraction = place - first as f64;
    let v: [f64; 4] = std::array::from_fn(|c| {
        let next = ((first + 1) * 4 + c).min(table.len() - 4 + c);
        table[first * 4 + c] * (1.0 - fraction) + table[next] * fraction
    });
    (DVec3::new(v[0], v[1], v[2]), v[3].clamp(0.0, 1.0))
}

/// The density, as a scalar, up to which a table makes everything transparent.
fn transparent_below(cx: &mut Lowering<'_>, table: ResourceId) -> ResourceId {
    let threshold = cx.intermediate("threshold", Shape::Scalar);
    cx.pass("threshold", shader!("volumes/transfer_threshold")).read("transfer", table, Reach::Whole).write("out", threshold).add();
    threshold
}

impl Node for VolumeRender {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        if let EdgeOr::Edge(table) = &self.transfer {
            let TableType { len, element } = inputs.table(table);
            if element != Element::F32 || !len.is_multiple_of(4) {
                return Err(Mistake::in_field("transfer", format!("is a table of {len} {element:?}"))
                    .hint("expected floats: red, green, blue and opacity for each density"));
            }
        }
        Ok(Output::out(self.camera.image(4)?))
    }

    fn makes_alpha(&self) -> bool {
        true
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (volume, out, border) = (cx.input(&self.volume), cx.output("out"), cx.border());
        let table = match &self.transfer {
            EdgeOr::Edge(table) => Some(cx.input(table)),
            EdgeOr::Value(Transfer::Lecture) => None,
        };
        let render = with_bricks(&shader!("volumes/volume_render"));
        let (shader, transfer) = match table {
            Some(_) => (render, shader!("volumes/transfer_table")),
            None => (with_shading(&render), shader!("volumes/transfer_lecture")),
        };
        let bricks = extremes(cx, volume, border, table.is_some() || self.alpha_exponent >= 0.0);
        let threshold = table.map(|table| transparent_below(cx, table));
        let pass = cx.pass("", Shader::builtin(&shader.path, &format!("{}\n{}", shader.source, transfer.source)));
        let mut pass = self
            .camera
            .describe(pass)
            .read_with("volume", volume, Reach::Whole, border, Filter::Linear)
            .read_with("bricks", bricks, Reach::Whole, Border::Clamp, Filter::Nearest)
            .write("out", out)
            .constant("BACK_TO_FRONT", self.order == Order::BackToFront)
            .param("step_length", self.step() as f32)
            .param("light", self.light)
            .param("alpha_exponent", self.alpha_exponent)
            .param("alpha_center", self.alpha_center);
        for (port, id) in [("transfer", table), ("threshold", threshold)] {
            if let Some(id) = id {
                pass = pass.read(port, id, Reach::Whole);
            }
        }
        pass.add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (volume, view) = (cx.volume(&self.volume), self.camera.view());
        let sample = |p: DVec3| match &self.transfer {
            EdgeOr::Edge(table) => look_up(cx.table(table), volume.sample(p.to_array(), cx.border)[0]),
            EdgeOr::Value(Transfer::Lecture) => self.lecture(volume, p, cx.border, &view),
        };
        vec![Tensor::Image(view.picture(4, |ray| self.composite(&ray, view.stretch(ray.direction), sample)))]
    }
}
