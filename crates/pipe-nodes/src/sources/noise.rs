//! `Noise`: reproducible randomness, from integer hashes only.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::components::Size;
use crate::shader;
use crate::sources::canvas::{SIZE, image, paint};

/// Noise in 0..1, one channel; the same on every device and in every run for the same seed.
///
/// `White` is a hash of the pixel. The others live on a lattice of `frequency` cells across the larger side: `Value`
/// interpolates random values, `Perlin` is gradient noise (K. Perlin 2002), `Simplex` the same on triangles, `Worley` the
/// distance to the nearest of one random point a cell, in cells, at most 1. Octaves double the frequency and halve the weight;
/// their sum is divided by the sum of weights.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Noise {
    /// Which noise.
    kind: Variety,
    /// Cells across the larger side.
    #[default = 8.0]
    #[schemars(range(min = 0.001, max = 16384.0))]
    frequency: f32,
    /// How many layers.
    #[default = 1]
    #[schemars(range(min = 1, max = 12))]
    octaves: u32,
    /// Another seed, another noise.
    seed: u32,
    /// Width and height; one number for a square.
    #[default(SIZE)]
    #[schemars(extend("x-unit" = "px"))]
    size: Size,
}

/// Kinds of noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
enum Variety {
    /// A value of its own for every pixel.
    White,
    /// Interpolated values.
    Value,
    /// Gradient noise.
    #[default]
    Perlin,
    /// Gradient noise on triangles.
    Simplex,
    /// Distance to the nearest point.
    Worley,
}

pub(super) const KIND: Kind = Kind::of::<Noise>(
    "Noise",
    Category::Sources,
    &[
        r#"Noise(size: (64, 48))"#,
        r#"Noise(kind: White, seed: 7, size: (61, 47))"#,
        r#"Noise(kind: Value, frequency: 5.5, octaves: 3, size: (61, 47))"#,
        r#"Noise(kind: Simplex, frequency: 6, octaves: 2, seed: 3, size: (61, 47))"#,
        r#"Noise(kind: Worley, frequency: 7, seed: 1, size: (61, 47))"#,
    ],
)
.tolerance(2e-4, 0.0);

/// PCG's output permutation as a hash (M. Jarzynski, M. Olano 2020, `pcg3d`): three words in, the first word out.
fn hash(x: i32, y: i32, z: u32) -> u32 {
    let step = |v: u32| v.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let (mut a, mut b, mut c) = (step(x as u32), step(y as u32), step(z));
    a = a.wrapping_add(b.wrapping_mul(c));
    b = b.wrapping_add(c.wrapping_mul(a));
    c = c.wrapping_add(a.wrapping_mul(b));
    a ^= a >> 16;
    b ^= b >> 16;
    c ^= c >> 16;
    a.wrapping_add(b.wrapping_mul(c))
}

fn unit(h: u32) -> f64 {
    f64::from(h >> 8) / f64::from(1 << 24)
}

/// The dot product of the lattice point's gradient with an offset.
fn gradient(x: i32, y: i32, seed: u32, dx: f64, dy: f64) -> f64 {
    let angle = std::f64::consts::TAU * unit(hash(x, y, seed));
    angle.cos() * dx + angle.sin() * dy
}

fn value(kind: Variety, x: f64, y: f64, seed: u32) -> f64 {
    let (xi, yi) = (x.floor(), y.floor());
    let (fx, fy) = (x - xi, y - yi);
    let (i, j) = (xi as i32, yi as i32);
    let fade = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    match kind {
        Variety::White => unit(hash(i, j, seed)),
        Variety::Value => {
            let v = |dx, dy| unit(hash(i + dx, j + dy, seed));
            lerp(lerp(v(0, 0), v(1, 0), fade(fx)), lerp(v(0, 1), v(1, 1), fade(fx)), fade(fy))
        }
        Variety::Perlin => {
            let g = |dx: i32, dy: i32| gradient(i + dx, j + dy, seed, fx - f64::from(dx), fy - f64::from(dy));
            0.5 + lerp(lerp(g(0, 0), g(1, 0), fade(fx)), lerp(g(0, 1), g(1, 1), fade(fx)), fade(fy)) / std::f64::consts::SQRT_2
        }
        Variety::Simplex => {
            let (skew, unskew) = (0.366_025_403_784_438_6, 0.211_324_865_405_187_13);
            let s = (x + y) * skew;
            let (i, j) = ((x + s).floor(), (y + s).floor());
            let t = (i + j) * unskew;
            let (x0, y0) = (x - (i - t), y - (j - t));
            let (a, b) = if x0 > y0 { (1, 0) } else { (0, 1) };
            let corner = |di: i32, dj: i32| {
                let shift = f64::from(di + dj) * unskew;
                let (dx, dy) = (x0 - f64::from(di) + shift, y0 - f64::from(dj) + shift);
                let m = (0.5 - dx * dx - dy * dy).max(0.0);
                m * m * m * m * gradient(i as i32 + di, j as i32 + dj, seed, dx, dy)
            };
            (0.5 + 0.5 * 70.0 * (corner(0, 0) + corner(a, b) + corner(1, 1))).clamp(0.0, 1.0)
        }
        Variety::Worley => {
            let mut least = f64::MAX;
            for dj in -1..=1 {
                for di in -1..=1 {
                    let px = f64::from(di) + unit(hash(i + di, j + dj, seed));
                    let py = f64::from(dj) + unit(hash(i + di, j + dj, seed ^ 0x9E37_79B9));
                    least = least.min((px - fx).powi(2) + (py - fy).powi(2));
                }
            }
            least.sqrt().min(1.0)
        }
    }
}

impl Noise {
    /// Cells a pixel.
    fn scale(&self) -> f32 {
        if self.kind == Variety::White { 1.0 } else { self.frequency / self.size.0[0].max(self.size.0[1]) as f32 }
    }

    fn octaves(&self) -> u32 {
        if self.kind == Variety::White { 1 } else { self.octaves }
    }
}

impl Node for Noise {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        image(self.size, 1)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (scale, octaves) = (self.scale(), self.octaves());
        let seed = self.seed ^ cx.seed() as u32;
        paint(cx, shader!("sources/noise"))
            .constant("VARIETY", self.kind as i32)
            .constant("OCTAVES", octaves as i32)
            .param("scale", scale)
            .param("seed", seed)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let seed = self.seed ^ cx.seed as u32;
        let scale = f64::from(self.scale());
        vec![Tensor::Image(Raster::from_fn(self.size.0, 1, |x, y| {
            let (mut sum, mut weights) = (0.0, 0.0);
            for octave in 0..self.octaves() {
                let (f, w) = (f64::from(1_u32 << octave), 0.5_f64.powi(octave as i32));
                let at = |v: i64| (v as f64 + if self.kind == Variety::White { 0.0 } else { 0.5 }) * scale * f;
                sum += w * value(self.kind, at(x), at(y), seed.wrapping_add(octave));
                weights += w;
            }
            [sum / weights; 4]
        }))]
    }
}
