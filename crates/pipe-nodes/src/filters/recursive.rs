//! A Gaussian whose cost does not depend on σ: Deriche's recursive filter of order 4.
//!
//! The half of the Gaussian to each side is two damped oscillations, each a complex one-pole recursion:
//! h(n) = Re Σ αₖ exp(−λₖ n/σ). R. Deriche, Recursively Implementing the Gaussian and its Derivatives, INRIA 1893 (1993);
//! coefficients as in P. Getreuer, A Survey of Gaussian Convolution Algorithms, IPOL 3 (2013), K = 4.
//!
//! A line is cut into runs. Each run warms its state up over some σ before it, reading through the border policy, so that
//! all borders are right, and runs go in parallel. A value that is not finite would stay in the state for ever: it is kept out,
//! and spoils the pixels within 3σ, as it does where the Gaussian is cut there.

use pipe_graph::prelude::*;

use crate::filters::gaussian::{Axis, both_axes, convolve, radius, wide_weights};
use crate::shader;

/// (Re, Im) of α and λ; each stands for itself and its conjugate.
const ALPHA: [(f64, f64); 2] = [(0.84, 1.8675), (-0.34015, -0.1299)];
const LAMBDA: [(f64, f64); 2] = [(1.783, 0.6318), (1.723, 1.997)];

/// Standard deviations after which the response is below 2e-5.
const WARM: f32 = 6.0;

/// Below it the sum over pixels is no longer the integral: a convolution takes its place.
const LEAST_SIGMA: f32 = 0.5;

/// Poles and gains of one σ.
struct Response {
    /// exp(−λ/σ)
    poles: [[f32; 2]; 2],
    /// α over the sum of the whole response.
    gains: [[f32; 2]; 2],
}

fn response(sigma: f32) -> Response {
    let s = f64::from(sigma);
    let pole = |(re, im): (f64, f64)| {
        let m = (-re / s).exp();
        (m * (im / s).cos(), -m * (im / s).sin())
    };
    let poles = LAMBDA.map(pole);
    // Σ over n ≥ 0 is α/(1 − p), over n ≥ 1 α·p/(1 − p); both sides together α(1 + p)/(1 − p).
    let total: f64 = ALPHA
        .iter()
        .zip(poles)
        .map(|(a, p)| {
            let (nr, ni) = (a.0 * (1.0 + p.0) - a.1 * p.1, a.0 * p.1 + a.1 * (1.0 + p.0));
            let (dr, di) = (1.0 - p.0, -p.1);
            (nr * dr + ni * di) / (dr * dr + di * di)
        })
        .sum();
    let small = |v: (f64, f64), scale: f64| [(v.0 * scale) as f32, (v.1 * scale) as f32];
    Response { poles: poles.map(|p| small(p, 1.0)), gains: ALPHA.map(|a| small(a, 1.0 / total)) }
}

/// Declares both axes.
pub(super) fn recursive(cx: &mut Lowering<'_>, sigma: [f32; 2], image: ResourceId, out: ResourceId) {
    both_axes(cx, "", sigma, [image, out], recursive_axis);
}

/// Declares one axis: a filter to the right, and one to the left that adds what the first found.
pub(super) fn recursive_axis(cx: &mut Lowering<'_>, suffix: &str, axis: Axis, sigma: f32, [image, out]: [ResourceId; 2]) {
    if sigma < LEAST_SIGMA {
        return convolve(cx, suffix, axis, &wide_weights(sigma), image, out);
    }
    let shape = cx.shape(out);
    let forward = cx.intermediate(&format!("{suffix}.forward"), shape);
    let Response { poles, gains } = response(sigma);
    let warm = (WARM * sigma).ceil() as u32;
    let run = 128.max(2 * warm);
    let along_x = axis == Axis::X;
    let reach = if along_x { Reach::Around(run + warm, 0) } else { Reach::Around(0, run + warm) };
    let block = if along_x { [run, 1] } else { [1, run] };
    for (name, backward) in [("forward", false), ("backward", true)] {
        let shader = if backward { shader!("filters/recursive_backward") } else { shader!("filters/recursive_forward") };
        let mut pass =
            cx.pass(&format!("{suffix}.{name}"), shader).entry(Entry::Each).grid(Grid::Blocks(block)).read("image", image, reach);
        if backward {
            pass = pass.read("forward", forward, Reach::Point);
        }
        pass.write("out", if backward { out } else { forward })
            .constant("RUN", run as i32)
            .constant("WARM", warm as i32)
            .constant("RADIUS", radius(sigma) as i32)
            .constant("ALONG_X", along_x)
            .param("pole0", poles[0])
            .param("pole1", poles[1])
            .param("gain0", gains[0])
            .param("gain1", gains[1])
            .add();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filters::gaussian::weights;

    /// The response is within 1e-3 of the Gaussian, as a weight and summed up to a step.
    #[test]
    fn the_response_is_a_gaussian() {
        for sigma in [1.0_f32, 2.0, 8.0, 77.0, 500.0] {
            let r = response(sigma);
            let n = (8.0 * sigma).ceil() as u32;
            let exact = weights(sigma, n);
            let (mut step, mut exact_step, mut worst) = (0.0, 0.0, 0.0_f64);
            for k in -(n as i64)..=n as i64 {
                let h: f64 = (0..2)
                    .map(|i| {
                        let (pr, pi) = (f64::from(r.poles[i][0]), f64::from(r.poles[i][1]));
                        let (m, a) = (pr.hypot(pi).powi(k.abs() as i32), pi.atan2(pr) * k.abs() as f64);
                        m * (f64::from(r.gains[i][0]) * a.cos() - f64::from(r.gains[i][1]) * a.sin())
                    })
                    .sum();
                step += h;
                exact_step += exact[(k + n as i64) as usize];
                worst = worst.max((step - exact_step).abs());
            }
            assert!(worst < 1e-3, "σ {sigma}: {worst}");
        }
    }
}
