//! What light travels through: the extinction coefficient σt at every point of the unit cube, in 1/length.
//!
//! A node hands its passes to [`Inside::pass`], whose shaders may then call `sigma_t(p: vec3f) -> f32`; its twin asks
//! [`Extinction`].

use glam::DVec3;
use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;

use super::camera::Ray;
use super::light::Arrival;
use crate::shader;

/// A medium written in the graph, or a volume that holds σt, interpolated trilinearly; what is below 0, or NaN, counts as 0.
pub(super) type Medium = EdgeOr<Volume, Written>;

/// A medium as a graph writes it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) enum Written {
    /// The same σt everywhere.
    Homogeneous {
        /// Extinction coefficient, at least 0, in 1/length of the unit cube.
        sigma_t: f32,
    },
    /// A dark room filled with thin haze, thicker at the floor: light from above comes through a hole in its roof.
    CloudChamber {
        /// The haze has σt = 0.5·density_scale.
        #[serde(default = "one")]
        density_scale: f32,
    },
    /// A volume of densities.
    Scaled {
        /// The densities.
        volume: In<Volume>,
        /// σt where the density is 1.
        sigma_t: f32,
    },
}

const fn one() -> f32 {
    1.0
}

/// Default of a node's field.
pub(super) const fn homogeneous() -> Medium {
    EdgeOr::Value(Written::Homogeneous { sigma_t: 1.0 })
}

/// The largest σt that there is: in a volume what is larger, infinity too, counts as this.
const MOST: f32 = 1e6;

/// σt of the walls and the roof of the cloud chamber.
const WALL: f32 = 100.0;

/// What is wrong with a medium's numbers.
pub(super) fn check(medium: &Medium) -> Result<(), Mistake> {
    let (name, value) = match medium {
        EdgeOr::Edge(_) => return Ok(()),
        EdgeOr::Value(Written::Homogeneous { sigma_t } | Written::Scaled { sigma_t, .. }) => ("sigma_t", sigma_t),
        EdgeOr::Value(Written::CloudChamber { density_scale }) => ("density_scale", density_scale),
    };
    if (0.0..=MOST).contains(value) {
        return Ok(());
    }
    Err(Mistake::in_field("medium", format!("{name} is {value}")).hint("expected 0 to 1e6"))
}

/// What fills the cube: a formula, or a volume to be multiplied by σt.
#[derive(Clone, Copy)]
enum Filling {
    Homogeneous { sigma_t: f32 },
    CloudChamber { density_scale: f32 },
    Volume { port: In<Volume>, sigma_t: f32 },
}

impl Filling {
    const fn of(medium: &Medium) -> Self {
        match *medium {
            EdgeOr::Edge(port) => Self::Volume { port, sigma_t: 1.0 },
            EdgeOr::Value(Written::Scaled { volume, sigma_t }) => Self::Volume { port: volume, sigma_t },
            EdgeOr::Value(Written::Homogeneous { sigma_t }) => Self::Homogeneous { sigma_t },
            EdgeOr::Value(Written::CloudChamber { density_scale }) => Self::CloudChamber { density_scale },
        }
    }
}

/// A medium on the GPU.
pub(super) struct Inside {
    filling: Filling,
    majorant: Value,
}

impl Inside {
    /// Declares what finds the largest σt.
    pub(super) fn new(cx: &mut Lowering<'_>, medium: &Medium) -> Self {
        let filling = Filling::of(medium);
        let majorant = match filling {
            Filling::Homogeneous { sigma_t } => Value::F32(sigma_t),
            Filling::CloudChamber { density_scale } => Value::F32(WALL.max(0.5 * density_scale)),
            Filling::Volume { port, sigma_t } => {
                let volume = cx.input(&port);
                Value::Driven(largest(cx, volume, sigma_t))
            }
        };
        Self { filling, majorant }
    }

    /// Whether σt is the same everywhere.
    pub(super) const fn is_homogeneous(&self) -> bool {
        matches!(self.filling, Filling::Homogeneous { .. })
    }

    /// The largest σt.
    pub(super) fn majorant(&self) -> Value {
        self.majorant.clone()
    }

    /// A pass whose shader may call `sigma_t(p)`; `parts` are texts that it needs besides its own.
    pub(super) fn pass<'b, 'a>(&self, cx: &'b mut Lowering<'a>, suffix: &str, shader: &Shader, parts: &[Shader]) -> PassBuilder<'b, 'a> {
        let medium = match self.filling {
            Filling::Homogeneous { .. } => shader!("volumes/homogeneous"),
            Filling::CloudChamber { .. } => shader!("volumes/cloud_chamber"),
            Filling::Volume { .. } => shader!("volumes/medium"),
        };
        let text = parts.iter().chain([&medium]).fold(shader.source.to_string(), |text, part| text + "\n" + &part.source);
        let (border, shader) = (cx.border(), Shader::builtin(&shader.path, &text));
        match self.filling {
            Filling::Homogeneous { sigma_t } => cx.pass(suffix, shader).param("sigma_t", sigma_t),
            Filling::CloudChamber { density_scale } => cx.pass(suffix, shader).param("density_scale", density_scale).param("wall", WALL),
            Filling::Volume { port, sigma_t } => {
                let volume = cx.input(&port);
                cx.pass(suffix, shader)
                    .read_with("medium", volume, Reach::Whole, border, Filter::Linear)
                    .constant("MOST", MOST)
                    .param("sigma_t", sigma_t)
            }
        }
    }
}

/// The largest value of a volume, at least 0, times σt, as a scalar.
fn largest(cx: &mut Lowering<'_>, volume: ResourceId, sigma_t: f32) -> ResourceId {
    let Shape::Volume(ty) = cx.shape(volume) else { unreachable!("a volume edge carries a volume") };
    let mut len = ty.size[1] * ty.size[2];
    let mut terms = cx.intermediate("row_maxima", Shape::floats(len));
    cx.pass("row_maxima", shader!("volumes/row_maxima")).read("medium", volume, Reach::Whole).write("out", terms).add();
    let text = shader!("volumes/table_maximum");
    let ending = |text: &Shader, end: &str| Shader::builtin(&text.path, &format!("{}\n{end}\n", text.source));
    while len > 64 {
        len = len.div_ceil(64);
        let maxima = cx.intermediate("maxima", Shape::floats(len));
        cx.pass("maxima", ending(&text, "fn at(i: i32) -> f32 { return strided_maximum(i); }"))
            .read("terms", terms, Reach::Whole)
            .write("out", maxima)
            .param("stride", len as i32)
            .add();
        terms = maxima;
    }
    let out = cx.intermediate("maximum", Shape::Scalar);
    cx.pass("maximum", ending(&text, "fn at(i: i32) -> vec4f { return vec4f(min(params.sigma_t * strided_maximum(0), MOST)); }"))
        .read("terms", terms, Reach::Whole)
        .write("out", out)
        .param("stride", 1_i32)
        .param("sigma_t", sigma_t)
        .constant("MOST", MOST)
        .add();
    out
}

/// A medium in double precision.
pub(super) struct Extinction<'a> {
    filling: Filling,
    volume: Option<&'a Block>,
    border: Border,
    /// The largest σt.
    pub(super) majorant: f64,
}

impl<'a> Extinction<'a> {
    /// The medium of a node.
    pub(super) fn new(cx: &Reference<'a>, medium: &Medium) -> Self {
        let filling = Filling::of(medium);
        let (volume, majorant) = match filling {
            Filling::Homogeneous { sigma_t } => (None, f64::from(sigma_t)),
            Filling::CloudChamber { density_scale } => (None, f64::from(WALL.max(0.5 * density_scale))),
            Filling::Volume { port, sigma_t } => {
                let block = cx.volume(&port);
                (Some(block), (block.voxels.iter().map(|v| v[0]).fold(0.0, f64::max) * f64::from(sigma_t)).min(f64::from(MOST)))
            }
        };
        Self { filling, volume, border: cx.border, majorant }
    }

    /// σt at a point.
    pub(super) fn at(&self, p: DVec3) -> f64 {
        match (self.filling, self.volume) {
            (Filling::Volume { sigma_t, .. }, Some(block)) => {
                (block.sample(p.to_array(), self.border)[0].max(0.0) * f64::from(sigma_t)).min(f64::from(MOST))
            }
            (Filling::CloudChamber { density_scale }, _) => cloud_chamber(p, f64::from(density_scale)),
            _ => self.majorant,
        }
    }

    /// Whether σt is the same everywhere.
    pub(super) const fn is_homogeneous(&self) -> bool {
        matches!(self.filling, Filling::Homogeneous { .. })
    }

    /// ∫σt on the way from a point of the cube to a light, in this many pieces.
    pub(super) fn depth_to(&self, p: DVec3, light: &Arrival, pieces: u32) -> f64 {
        let leave = Ray { origin: p, direction: light.towards }.cube_span().map_or(0.0, |span| span[1]);
        let piece = light.distance.min(leave) / f64::from(pieces);
        (0..pieces).map(|i| self.at(p + (f64::from(i) + 0.5) * piece * light.towards) * piece).sum()
    }

    /// What a ray sees of light that is scattered towards the eye (`scattered`: radiance for each unit of σt), and the
    /// opacity of the medium, by this many pieces in each of which both are constant.
    pub(super) fn seen(&self, ray: &Ray, pieces: u32, scattered: impl Fn(DVec3) -> f64) -> [f64; 4] {
        let Some([enter, leave]) = ray.cube_span() else { return [0.0; 4] };
        let piece = (leave - enter) / f64::from(pieces);
        let (mut radiance, mut depth) = (0.0_f64, 0.0_f64);
        for i in 0..pieces {
            let p = ray.at(enter + (f64::from(i) + 0.5) * piece);
            let sigma = self.at(p);
            radiance += (-depth).exp() * -(-sigma * piece).exp_m1() * scattered(p);
            depth += sigma * piece;
        }
        [radiance, radiance, radiance, -(-depth).exp_m1()]
    }
}

fn cloud_chamber(p: DVec3, density_scale: f64) -> f64 {
    let hole = (p.x - 0.5).powi(2) + (p.z - 0.5).powi(2) < 0.001;
    let roof = p.y > 0.78 && p.y < 0.83 && !hole;
    if roof || p.x < 0.02 || p.y < 0.02 || p.z > 0.98 {
        f64::from(WALL)
    } else if p.y < 0.2 {
        (1.0 - p.y) * 5.0
    } else {
        0.5 * density_scale
    }
}
