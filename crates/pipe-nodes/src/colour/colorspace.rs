//! `Colorspace`: primaries, white point and transfer function.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// Converts colour between colour spaces: transfer function, primaries and white point (Bradford). Alpha is kept.
///
/// Spaces: `srgb` and `rec709` (the same primaries), `rec2020`, `p3` (D65), `acescg`, `aces2065-1`, `xyz` (D65, Y = 1 for
/// white). `srgb` and `p3` are encoded with the sRGB curve, `rec709` and `rec2020` with that of ITU-R BT.709; put
/// `linear-` before the name (`linear-srgb`) for linear values; the others are always linear.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Colorspace {
    /// The image.
    image: In<Image>,
    /// The space that it is in.
    #[default("linear-srgb".to_owned())]
    from: String,
    /// The space that it shall be in.
    #[default("linear-srgb".to_owned())]
    to: String,
}

pub(super) const KIND: Kind = Kind::of::<Colorspace>(
    "Colorspace",
    Category::Colour,
    &[
        r#"Colorspace(image: "in", from: "linear-srgb", to: "acescg")"#,
        r#"Colorspace(image: "in", from: "linear-srgb", to: "srgb")"#,
        r#"Colorspace(image: "in", from: "rec2020", to: "linear-p3")"#,
        r#"Colorspace(image: "in", from: "aces2065-1", to: "xyz")"#,
        r#"Colorspace(image: "in", from: "xyz", to: "rec709")"#,
    ],
)
.tolerance(2e-6, 2e-5);

type Matrix = [[f64; 3]; 3];

/// A transfer function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Transfer {
    Linear = 0,
    Srgb = 1,
    Bt709 = 2,
}

/// Chromaticities of red, green, blue and white; none for XYZ.
type Primaries = Option<[[f64; 2]; 4]>;

const D65: [f64; 2] = [0.3127, 0.3290];
const ACES_WHITE: [f64; 2] = [0.32168, 0.33767];

fn space(name: &str) -> Option<(Primaries, Transfer)> {
    let rec709 = Some([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], D65]);
    let rec2020 = Some([[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65]);
    let p3 = Some([[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], D65]);
    Some(match name {
        "srgb" => (rec709, Transfer::Srgb),
        "rec709" => (rec709, Transfer::Bt709),
        "linear-srgb" | "linear-rec709" => (rec709, Transfer::Linear),
        "rec2020" => (rec2020, Transfer::Bt709),
        "linear-rec2020" | "rec2020-linear" => (rec2020, Transfer::Linear),
        "p3" => (p3, Transfer::Srgb),
        "linear-p3" => (p3, Transfer::Linear),
        "acescg" | "linear-acescg" => (Some([[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], ACES_WHITE]), Transfer::Linear),
        "aces2065-1" | "linear-aces2065-1" => (Some([[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.0770], ACES_WHITE]), Transfer::Linear),
        "xyz" | "linear-xyz" => (None, Transfer::Linear),
        _ => return None,
    })
}

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn apply(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| (0..3).map(|j| m[i][j] * v[j]).sum())
}

fn inverse(m: &Matrix) -> Matrix {
    let c = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let det: f64 = (0..3).map(|j| m[0][j] * c(0, j)).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| c(j, i) / det))
}

fn xyz_of(xy: [f64; 2]) -> [f64; 3] {
    [xy[0] / xy[1], 1.0, (1.0 - xy[0] - xy[1]) / xy[1]]
}

/// Linear RGB of these primaries to XYZ of D65 (SMPTE RP 177; Bradford adaptation).
fn to_xyz(primaries: Primaries) -> Matrix {
    let Some([r, g, b, white]) = primaries else { return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };
    let columns = [xyz_of(r), xyz_of(g), xyz_of(b)];
    let p: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
    let s = apply(&inverse(&p), xyz_of(white));
    let m: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| p[i][j] * s[j]));
    const BRADFORD: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
    let (from, to) = (apply(&BRADFORD, xyz_of(white)), apply(&BRADFORD, xyz_of(D65)));
    let scaled: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| BRADFORD[i][j] * to[i] / from[i]));
    times(&times(&inverse(&BRADFORD), &scaled), &m)
}

fn decode(v: f64, t: Transfer) -> f64 {
    let a = v.abs();
    v.signum()
        * match t {
            Transfer::Linear => a,
            Transfer::Srgb if a <= 0.04045 => a / 12.92,
            Transfer::Srgb => ((a + 0.055) / 1.055).powf(2.4),
            Transfer::Bt709 if a < 0.081 => a / 4.5,
            Transfer::Bt709 => ((a + 0.099) / 1.099).powf(1.0 / 0.45),
        }
}

fn encode(v: f64, t: Transfer) -> f64 {
    let a = v.abs();
    v.signum()
        * match t {
            Transfer::Linear => a,
            Transfer::Srgb if a <= 0.003_130_8 => a * 12.92,
            Transfer::Srgb => 1.055 * a.powf(1.0 / 2.4) - 0.055,
            Transfer::Bt709 if a < 0.018 => a * 4.5,
            Transfer::Bt709 => 1.099 * a.powf(0.45) - 0.099,
        }
}

impl Colorspace {
    fn parts(&self) -> Result<(Matrix, Transfer, Transfer), Mistake> {
        let find = |field: &str, name: &str| {
            space(name).ok_or_else(|| {
                Mistake::in_field(field, format!("names no colour space: \"{name}\""))
                    .hint("expected srgb, rec709, rec2020, p3, acescg, aces2065-1 or xyz, with `linear-` before it for linear values")
            })
        };
        let ((a, decode), (b, encode)) = (find("from", &self.from)?, find("to", &self.to)?);
        Ok((times(&inverse(&to_xyz(b)), &to_xyz(a)), decode, encode))
    }
}

impl Node for Colorspace {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        self.parts().map(drop)
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (m, decode, encode) = self.parts()?;
        let row = |i: usize| m[i].map(|v| v as f32);
        point(cx, &self.image, shader!("colour/colorspace"))
            .constant("DECODE", decode as i32)
            .constant("ENCODE", encode as i32)
            .param("row0", row(0))
            .param("row1", row(1))
            .param("row2", row(2))
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let Ok((m, from, to)) = self.parts() else { return Vec::new() };
        map_rgb(cx, &self.image, |c| apply(&m, c.map(|v| decode(v, from))).map(|v| encode(v, to)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// IEC 61966-2-1 and SMPTE RP 177 give these to four places; ACEScg from the Academy's TB-2014-004 and S-2014-004.
    #[test]
    fn matrices_are_the_published_ones() {
        let near = |a: &Matrix, b: &Matrix, e: f64| a.iter().flatten().zip(b.iter().flatten()).all(|(x, y)| (x - y).abs() < e);
        let srgb = to_xyz(space("linear-srgb").expect("known").0);
        assert!(near(&srgb, &[[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]], 1e-4), "{srgb:?}");
        let to_ap1 = times(&inverse(&to_xyz(space("acescg").expect("known").0)), &srgb);
        assert!(near(&to_ap1, &[[0.6131, 0.3395, 0.0474], [0.0702, 0.9164, 0.0134], [0.0206, 0.1096, 0.8698]], 2e-4), "{to_ap1:?}");
    }
}
