//! `GaussianImportance`: a Gaussian by equally weighted samples at its quantiles, with linear sampling.
//!
//! The i-th of M samples along an axis lies at σ·Φ⁻¹((2i−1)/2M). It converges to the Gaussian as M grows.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::gaussian::Axis;
use crate::shader;

/// Blurs by importance sampling: equal weights 1/M at the offsets σ·Φ⁻¹((2i−1)/2M), i = 1..M, along each axis, read with
/// linear sampling.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct GaussianImportance {
    /// The image.
    image: In<Image>,
    /// Standard deviation.
    #[default = 2.0]
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "px"))]
    sigma: f32,
    /// Samples M along each axis.
    #[default = 5]
    #[schemars(range(min = 1, max = 1024))]
    samples: u32,
}

pub(super) const KIND: Kind = Kind::of::<GaussianImportance>(
    "GaussianImportance",
    Category::Filters,
    &[
        r#"GaussianImportance(image: "in")"#,
        r#"GaussianImportance(image: "grey", sigma: 5, samples: 16)"#,
        r#"GaussianImportance(image: "in", samples: 1)"#,
    ],
);

/// The inverse of the normal distribution function, by Acklam's rational approximation refined by one Halley step to
/// double precision.
fn probit(p: f64) -> f64 {
    const A: [f64; 6] =
        [-3.969683028665376e1, 2.209460984245205e2, -2.759285104469687e2, 1.383_577_518_672_69e2, -3.066479806614716e1, 2.506628277459239];
    const B: [f64; 5] = [-5.447609879822406e1, 1.615858368580409e2, -1.556989798598866e2, 6.680131188771972e1, -1.328068155288572e1];
    const C: [f64; 6] =
        [-7.784894002430293e-3, -3.223964580411365e-1, -2.400758277161838, -2.549732539343734, 4.374664141464968, 2.938163982698783];
    const D: [f64; 4] = [7.784695709041462e-3, 3.224671290700398e-1, 2.445134137142996, 3.754408661907416];
    let poly = |c: &[f64], x: f64| c.iter().fold(0.0, |s, c| s * x + c);
    let tail = |p: f64| {
        let q = (-2.0 * p.ln()).sqrt();
        poly(&C, q) / (poly(&D, q) * q + 1.0)
    };
    let x = if p < 0.02425 {
        tail(p)
    } else if p > 1.0 - 0.02425 {
        -tail(1.0 - p)
    } else {
        let q = p - 0.5;
        let r = q * q;
        poly(&A, r) * q / (poly(&B, r) * r + 1.0)
    };
    let e = 0.5 * erfc(-x / std::f64::consts::SQRT_2) - p;
    let u = e * (2.0 * std::f64::consts::PI).sqrt() * (x * x / 2.0).exp();
    x - u / (1.0 + x * u / 2.0)
}

/// The complementary error function (W. J. Cody's scheme by Numerical Recipes' Chebyshev fit is accurate to 1.2e-7; a
/// series and a continued fraction are accurate to rounding).
fn erfc(x: f64) -> f64 {
    let z = x.abs();
    let value = if z < 2.5 {
        let (mut term, mut sum, mut n) = (z, z, 0.0);
        while term.abs() > 1e-18 * sum.abs() && n < 200.0 {
            n += 1.0;
            term *= -z * z / n;
            sum += term / (2.0 * n + 1.0);
        }
        1.0 - 2.0 / std::f64::consts::PI.sqrt() * sum
    } else {
        let fraction = (1..=60).rev().fold(0.0, |f, k| f64::from(k) / 2.0 / (z + f));
        (-z * z).exp() / std::f64::consts::PI.sqrt() / (z + fraction)
    };
    if x < 0.0 { 2.0 - value } else { value }
}

/// Offsets of the samples in units of σ.
fn quantiles(samples: u32) -> Vec<f64> {
    (1..=samples).map(|i| if 2 * i == samples + 1 { 0.0 } else { probit(f64::from(2 * i - 1) / f64::from(2 * samples)) }).collect()
}

/// Declares both axes.
pub(super) fn importance(cx: &mut Lowering<'_>, sigma: [f32; 2], samples: u32, image: ResourceId, out: ResourceId) {
    let shape = cx.shape(out);
    let rows = cx.intermediate("rows", shape);
    let offsets: Vec<f64> = quantiles(samples);
    for (suffix, axis, sigma, from, to) in [("rows", Axis::X, sigma[0], image, rows), ("columns", Axis::Y, sigma[1], rows, out)] {
        let table = cx.floats(&format!("{suffix}.offsets"), &offsets.iter().map(|o| (o * f64::from(sigma)) as f32).collect::<Vec<_>>());
        let most = offsets.iter().fold(0.0_f64, |m, o| m.max(o.abs())) * f64::from(sigma);
        let reach = most.ceil() as u32 + 1;
        let reach = if axis == Axis::X { Reach::Around(reach, 0) } else { Reach::Around(0, reach) };
        cx.pass(suffix, shader!("filters/importance"))
            .read("image", from, reach)
            .read("offsets", table, Reach::Whole)
            .write("out", to)
            .constant("SAMPLES", samples as i32)
            .constant("ALONG_X", axis == Axis::X)
            .add();
    }
}

/// The twin.
pub(super) fn importance_reference(image: &Raster, sigma: [f32; 2], samples: u32, border: Border) -> Raster {
    let pass = |image: &Raster, axis: Axis, sigma: f32| {
        let offsets: Vec<f64> = quantiles(samples).into_iter().map(|o| f64::from((o * f64::from(sigma)) as f32)).collect();
        Raster::from_fn(image.size, image.channels, |x, y| {
            let mut sum = [0.0; 4];
            for o in &offsets {
                let (x, y) = (x as f64 + 0.5, y as f64 + 0.5);
                let p = if axis == Axis::X { image.sample(x + o, y, border) } else { image.sample(x, y + o, border) };
                for c in 0..4 {
                    sum[c] += p[c] / f64::from(samples);
                }
            }
            sum
        })
    };
    pass(&pass(image, Axis::X, sigma[0]), Axis::Y, sigma[1])
}

impl Node for GaussianImportance {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        importance(cx, [self.sigma; 2], self.samples, image, out);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        vec![Tensor::Image(importance_reference(cx.image(&self.image), [self.sigma; 2], self.samples, cx.border))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy.stats.norm.ppf
    #[test]
    fn quantiles_are_those_of_scipy() {
        let expected = [-1.281_551_565_544_6, -0.524_400_512_708_041, 0.0, 0.524_400_512_708_041, 1.281_551_565_544_6];
        assert!(quantiles(5).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{:?}", quantiles(5));
        assert!((probit(0.001) + 3.090_232_306_167_813).abs() < 1e-11);
    }
}
