//! How an implicit step is solved: the second-order Richardson method (Golub & Varga 1961), x⁺ = x + α(r − Ax) +
//! β(x − x⁻), whose two numbers come from the bounds of A's spectrum and are best for it. The number of iterations to
//! a tolerance is known when planning, so no residual is ever measured. Rejected: conjugate gradients (two reductions
//! an iteration, each a wait for the whole image), and Chebyshev's method (other numbers in each iteration, hardly
//! fewer of them).

use super::wave::{Boundary, Medium};

/// An implicit one-step method of the wave equation: θ = 1 is backward Euler, θ = ½ Crank-Nicolson.
/// It solves (1 + θγh − θ²h²c²∇²)·v′ = r.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Solver {
    pub(super) theta: f64,
    /// α
    pub(super) gain: f64,
    /// β
    pub(super) inertia: f64,
    pub(super) iterations: u32,
}

/// More iterations a step than this no one waits for.
const MOST: u32 = 100_000;

impl Solver {
    /// For this medium on a grid of this size: until the error of the first guess has shrunk by `tolerance`.
    pub(super) fn new(theta: f64, medium: &Medium, size: [u32; 2], tolerance: f64) -> Self {
        let h = theta * f64::from(medium.dt);
        let sides: u32 = size.iter().map(|n| if *n == 1 { 2 } else { 1 }).sum();
        let open = if medium.boundary == Boundary::Absorbing { f64::from(sides) * medium.opening() } else { 0.0 };
        // −∇² of the 5-point stencil lies in 0..8 (Gershgorin).
        let low = 1.0 + h * f64::from(medium.damping);
        let high = low + h * open + h * h * 8.0 * medium.stiffness();
        let (a, b) = (low.sqrt(), high.sqrt());
        let rate = (b - a) / (b + a);
        Self { theta, gain: (2.0 / (a + b)).powi(2), inertia: rate * rate, iterations: iterations(rate, tolerance) }
    }
}

/// Smallest k with rateᵏ·(1 + k + rate·k) ≤ tolerance: what is left of an error after k iterations that begin with
/// x = x⁻, from `e_k = rateᵏ·(U_k(t) − rate·U_{k−1}(t))·e_0` with Chebyshev's `|U_k| ≤ k + 1`.
fn iterations(rate: f64, tolerance: f64) -> u32 {
    let left = |k: u32| f64::from(k) * rate.ln() + (1.0 + f64::from(k) * (1.0 + rate)).ln();
    if rate <= 0.0 {
        return 1;
    }
    let (mut low, mut high) = (0, 1);
    while left(high) > tolerance.ln() {
        if high >= MOST {
            return MOST;
        }
        (low, high) = (high, high * 2);
    }
    while high - low > 1 {
        let middle = low.midpoint(high);
        if left(middle) > tolerance.ln() { low = middle } else { high = middle }
    }
    high.min(MOST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iterations_reach_the_tolerance() {
        // One eigenvalue at a time, over the whole spectrum, in double precision.
        for (dt, c2) in [(1e-4, 20.0), (1e-2, 20.0), (0.1, 20.0), (1.0, 0.0)] {
            let medium = Medium { dt, dx: 0.01, c2, damping: 0.5, boundary: Boundary::Neumann };
            let solver = Solver::new(1.0, &medium, [64, 64], 1e-6);
            let (low, high) = (1.0 + f64::from(dt) * 0.5, 1.0 + f64::from(dt) * 0.5 + f64::from(dt).powi(2) * 8.0 * medium.stiffness());
            for i in 0..=100 {
                let lambda = low + (high - low) * f64::from(i) / 100.0;
                let (mut before, mut error) = (1.0, 1.0);
                for _ in 0..solver.iterations {
                    let next = error - solver.gain * lambda * error + solver.inertia * (error - before);
                    (before, error) = (error, next);
                }
                assert!(error.abs() <= 1.0001e-6, "dt {dt}, eigenvalue {lambda}: {error} is left");
            }
        }
    }

    #[test]
    fn a_small_step_takes_few_iterations() {
        let medium = Medium { dt: 1e-4, dx: 0.01, c2: 20.0, damping: 0.0, boundary: Boundary::Neumann };
        assert!(Solver::new(1.0, &medium, [64, 64], 1e-6).iterations <= 4);
    }
}
