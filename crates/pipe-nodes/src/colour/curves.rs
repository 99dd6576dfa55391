//! `Curves`: smooth curves through points.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_tinted, point, tinted};
use crate::shader;

/// Maps colour through smooth curves that pass through the given points and never overshoot them.
///
/// Monotone piecewise cubics by F. N. Fritsch and J. Butland (1984), the same as SciPy's `PchipInterpolator`; before the
/// first point and beyond the last a curve goes on as a straight line. Alpha is kept. A 1-channel image becomes colour
/// where channels have curves of their own.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Curves {
    /// The image.
    image: In<Image>,
    /// Points (in, out) with rising `in`: a list for all channels, or `(r: [(0, 0), (1, 1)], g: …, b: …)`, where a
    /// channel that is not named stays as it is; three lists are those of red, green and blue.
    points: Points,
}

type Knots = Vec<[f32; 2]>;

/// Points of the curves.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a list of points (in, out), or `(r: [points], g: [points], b: [points])`")]
enum Points {
    /// One curve for all channels.
    All(Knots),
    /// One for each of red, green and blue.
    Each([Knots; 3]),
    /// One for each of the named channels.
    Named(Named),
}

/// Points of single channels.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Named {
    /// Red.
    r: Option<Knots>,
    /// Green.
    g: Option<Knots>,
    /// Blue.
    b: Option<Knots>,
}

impl Default for Points {
    fn default() -> Self {
        Self::All(identity())
    }
}

fn identity() -> Knots {
    vec![[0.0, 0.0], [1.0, 1.0]]
}

pub(super) const KIND: Kind = Kind::of::<Curves>(
    "Curves",
    Category::Colour,
    &[
        r#"Curves(image: "in", points: [(0, 0), (0.25, 0.15), (0.75, 0.9), (1, 1)])"#,
        r#"Curves(image: "in", points: (r: [(0, 0.05), (0.5, 0.6), (1, 0.95)], b: [(0.1, 1), (0.2, 0.5), (0.8, 0.5), (1.5, 0)]))"#,
        r#"Curves(image: "in", points: [[(0, 0), (1, 2)], [(0, 0), (0.5, 0.5), (1, 0)], [(-1, -1), (0, 0), (1, 0.5), (4, 0.9)]])"#,
        r#"Curves(image: "grey", points: [(0, 1), (0.4, 0.2), (1, 0)])"#,
        r#"Curves(image: "grey", points: (g: [(0, 0), (0.5, 0.7), (1, 1)]))"#,
        r#"Curves(image: "in")"#,
    ],
)
.tolerance(2e-6, 2e-5);

/// Slopes at the knots, as `scipy.interpolate.PchipInterpolator` has them.
fn slopes(knots: &[[f32; 2]]) -> Vec<f64> {
    let at = |i: usize| knots[i].map(f64::from);
    let pieces: Vec<(f64, f64)> = (1..knots.len())
        .map(|i| {
            let ([x0, y0], [x1, y1]) = (at(i - 1), at(i));
            (x1 - x0, (y1 - y0) / (x1 - x0))
        })
        .collect();
    if let [(_, only)] = pieces[..] {
        return vec![only; 2];
    }
    // The three-point formula, kept from overshooting.
    let end = |(h0, d0): (f64, f64), (h1, d1): (f64, f64)| {
        let m = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
        if m * d0 <= 0.0 {
            0.0
        } else if d0 * d1 <= 0.0 && m.abs() > 3.0 * d0.abs() {
            3.0 * d0
        } else {
            m
        }
    };
    // A weighted harmonic mean; 0 at a turning point.
    let inner = |pair: &[(f64, f64)]| {
        let ((h0, d0), (h1, d1)) = (pair[0], pair[1]);
        let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
        if d0 * d1 <= 0.0 { 0.0 } else { (w0 + w1) / (w0 / d0 + w1 / d1) }
    };
    let n = pieces.len();
    std::iter::once(end(pieces[0], pieces[1]))
        .chain(pieces.windows(2).map(inner))
        .chain(std::iter::once(end(pieces[n - 1], pieces[n - 2])))
        .collect()
}

/// The curve at `x`, by Hermite's basis.
fn curve(knots: &[[f32; 2]], slopes: &[f64], x: f64) -> f64 {
    let at = |i: usize| knots[i].map(f64::from);
    let last = knots.len() - 1;
    let Some(i) = (0..last).rev().find(|i| x >= at(*i)[0]) else {
        return at(0)[1] + slopes[0] * (x - at(0)[0]);
    };
    let ([x0, y0], [x1, y1]) = (at(i), at(i + 1));
    if x > x1 {
        return y1 + slopes[i + 1] * (x - x1);
    }
    let (h, t) = (x1 - x0, (x - x0) / (x1 - x0));
    let s = 1.0 - t;
    y0 * (1.0 + 2.0 * t) * s * s + h * slopes[i] * t * s * s + y1 * t * t * (3.0 - 2.0 * t) - h * slopes[i + 1] * t * t * s
}

/// Knots as the shader takes them: x, y and the coefficients of d, d² and d³, d = v − x; a straight line in the last.
fn pieces(knots: &[[f32; 2]]) -> Vec<f32> {
    let m = slopes(knots);
    let last = knots.len() - 1;
    let mut out = Vec::with_capacity(knots.len() * 5);
    for (i, [x, y]) in knots.iter().enumerate() {
        let (mut c2, mut c3) = (0.0, 0.0);
        if i < last {
            let h = f64::from(knots[i + 1][0]) - f64::from(*x);
            let d = (f64::from(knots[i + 1][1]) - f64::from(*y)) / h;
            c2 = (3.0 * d - 2.0 * m[i] - m[i + 1]) / h;
            c3 = (m[i] + m[i + 1] - 2.0 * d) / (h * h);
        }
        out.extend([*x, *y, m[i] as f32, c2 as f32, c3 as f32]);
    }
    out
}

impl Curves {
    fn channels(&self) -> [Knots; 3] {
        match &self.points {
            Points::All(one) => [one.clone(), one.clone(), one.clone()],
            Points::Each(each) => each.clone(),
            Points::Named(Named { r, g, b }) => [r, g, b].map(|c| c.clone().unwrap_or_else(identity)),
        }
    }

    fn tints(&self) -> bool {
        !matches!(self.points, Points::All(_))
    }
}

impl Node for Curves {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        for knots in self.channels() {
            if !(2..=256).contains(&knots.len()) {
                let message = format!("has a curve of {} points", knots.len());
                return Err(Mistake::in_field("points", message).hint("expected 2 to 256 points (in, out)"));
            }
            if let Some(pair) = knots.windows(2).find(|pair| pair[1][0] <= pair[0][0]) {
                let ([a, _], [b, _]) = (pair[0], pair[1]);
                return Err(Mistake::in_field("points", format!("do not rise: {b} comes after {a}"))
                    .hint("order the points by their first number; no two may share it"));
            }
        }
        Ok(())
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        tinted(inputs, &self.image, self.tints())
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let channels = self.channels();
        let [r, g, b] = channels.each_ref().map(Vec::len);
        let table: Vec<f32> = channels.iter().flat_map(|knots| pieces(knots)).collect();
        let knots = cx.floats("knots", &table);
        point(cx, &self.image, shader!("colour/curves"))
            .read("knots", knots, Reach::Whole)
            .constant("GREEN", r as i32)
            .constant("BLUE", (r + g) as i32)
            .constant("END", (r + g + b) as i32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let curves = self.channels().map(|knots| (slopes(&knots), knots));
        map_tinted(cx, &self.image, self.tints(), |c| {
            std::array::from_fn(|i| {
                let (slopes, knots) = &curves[i];
                if c[i].is_nan() { c[i] } else { curve(knots, slopes, c[i]) }
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scipy.interpolate.PchipInterpolator(x, y)` of SciPy 1.x: its derivative at the knots, its values between them.
    #[test]
    fn curves_are_those_of_scipy() {
        type Case<'a> = (&'a [[f32; 2]], &'a [f64], &'a [(f64, f64)]);
        let cases: [Case<'_>; 4] = [
            (
                &[[0.0, 0.0], [0.25, 0.15], [0.75, 0.9], [1.0, 1.0]],
                &[0.300_000_052, 0.818_181_835, 0.593_406_706, 0.033_333_480_4],
                &[(0.05, 0.018_654_547_6), (0.3, 0.201_466_039), (0.62, 0.752_484_909), (0.9, 0.977_841_747)],
            ),
            (
                &[[-1.0, -1.0], [0.0, 0.0], [1.0, 0.5], [4.0, 0.9]],
                &[1.25, 0.666_666_667, 0.233_009_699, 0.0],
                &[(-0.75, -0.699_218_75), (0.5, 0.304_207_121), (2.1, 0.724_705_346), (3.5, 0.886_551_577)],
            ),
            (&[[0.0, 0.0], [0.5, 0.5], [1.0, 0.0]], &[2.0, 0.0, -2.0], &[(0.05, 0.095), (0.3, 0.42), (0.62, 0.4712), (0.9, 0.18)]),
            (
                &[[0.0, 0.0], [1.0, 0.1], [1.1, 5.0]],
                &[0.0, 0.274_021_351, 53.445_442_7],
                &[(0.055_000_001_2, 9.090_073_21e-5), (0.330_000_007, 0.005_489_180_83), (0.990_000_021, 0.097_284_524)],
            ),
        ];
        for (knots, expected, values) in cases {
            let m = slopes(knots);
            assert!(m.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7), "{m:?}, expected {expected:?}");
            for (x, y) in values {
                assert!((curve(knots, &m, *x) - y).abs() < 1e-8, "{knots:?} at {x}: {}, expected {y}", curve(knots, &m, *x));
            }
        }
    }

    #[test]
    fn two_points_are_a_straight_line_without_end() {
        let knots = [[0.0, 1.0], [0.5, 2.0]];
        let m = slopes(&knots);
        assert_eq!([-1.0, 0.25, 3.0].map(|x| curve(&knots, &m, x)), [-1.0, 1.5, 7.0]);
    }
}
