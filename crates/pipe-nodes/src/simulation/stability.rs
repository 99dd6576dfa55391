//! Which time steps an explicit integrator bears: the growth of a wave of angular frequency ω in one step is the spectral
//! radius of a 2×2 matrix, and the fastest wave of a grid has ω² = 8c²/dx².

use super::wave::Medium;
use super::wave_equation::Integrator;

/// Euler's and the second-order Runge-Kutta methods let undamped waves grow at any step: theirs counts as stable while
/// the fastest wave grows less than this in the whole run.
const TOLERATED: f64 = 10.0;

/// The amplification of (u, v) in one step of h, where c²∇²u = −ω²u.
fn amplification(integrator: Integrator, h: f64, omega2: f64, damping: f64) -> [[f64; 2]; 2] {
    let (w, g) = (omega2, damping);
    match integrator {
        Integrator::Euler => [[1.0, h], [-h * w, 1.0 - h * g]],
        Integrator::SymplecticEuler => [[1.0 - h * h * w, h * (1.0 - h * g)], [-h * w, 1.0 - h * g]],
        Integrator::Midpoint | Integrator::RungeKutta2 => {
            // 1 + hJ + h²J²/2, J = [[0, 1], [−w, −g]]
            let s = h * h / 2.0;
            [[1.0 - s * w, h - s * g], [-h * w + s * g * w, 1.0 - h * g + s * (g * g - w)]]
        }
        Integrator::Verlet => {
            let [a, b] = [1.0 - h * h * w / 2.0, h - h * h * g / 2.0];
            let d = 1.0 + h * g / 2.0;
            [[a, b], [-h / 2.0 * w * (1.0 + a) / d, (1.0 - h / 2.0 * g - h / 2.0 * w * b) / d]]
        }
        Integrator::BackwardEuler | Integrator::CrankNicolson => [[0.0; 2]; 2],
    }
}

fn spectral_radius([[a, b], [c, d]]: [[f64; 2]; 2]) -> f64 {
    let (half, det) = (f64::midpoint(a, d), a * d - b * c);
    let disc = half * half - det;
    if disc >= 0.0 { half.abs() + disc.sqrt() } else { det.sqrt() }
}

fn is_stable(integrator: Integrator, h: f64, medium: &Medium, steps: u32) -> bool {
    let fastest = 8.0 * medium.stiffness();
    let growth = (0..=16)
        .flat_map(|i| {
            let omega2 = fastest * f64::from(i) / 16.0;
            // Pixels at an absorbing edge are damped more.
            [0.0, medium.opening()].map(|edge| spectral_radius(amplification(integrator, h, omega2, f64::from(medium.damping) + edge)))
        })
        .fold(0.0, f64::max);
    match integrator {
        Integrator::SymplecticEuler | Integrator::Verlet => growth <= 1.0 + 1e-7,
        _ => growth.ln() * f64::from(steps) <= TOLERATED.ln(),
    }
}

/// The largest stable step of an explicit integrator, if `dt` is beyond it.
pub(super) fn exceeded_limit(integrator: Integrator, medium: &Medium, steps: u32) -> Option<f64> {
    let dt = f64::from(medium.dt);
    // The limit itself is stable, however it was rounded to 32 bits.
    if is_stable(integrator, dt * (1.0 - 1e-6), medium, steps) {
        return None;
    }
    let (mut low, mut high) = (0.0, dt);
    for _ in 0..100 {
        let middle = f64::midpoint(low, high);
        if is_stable(integrator, middle, medium, steps) { low = middle } else { high = middle }
    }
    Some(low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::wave::Boundary;

    fn medium(dt: f32, damping: f32) -> Medium {
        Medium { dt, dx: 0.01, c2: 20.0, damping, boundary: Boundary::Neumann }
    }

    /// Courant, Friedrichs & Lewy: c·dt/dx ≤ 1/√2 in two dimensions.
    #[test]
    fn symplectic_methods_stop_at_the_courant_limit() {
        let expected = 0.01 / 20.0_f64.sqrt() / 2.0_f64.sqrt();
        for integrator in [Integrator::SymplecticEuler, Integrator::Verlet] {
            let limit = exceeded_limit(integrator, &medium(0.01, 0.0), 100).expect("0.01 is beyond the limit");
            assert!((limit / expected - 1.0).abs() < 1e-5, "{integrator:?}: {limit}, expected {expected}");
            assert_eq!(exceeded_limit(integrator, &medium(expected as f32, 0.0), 1_000_000), None);
            assert_eq!(exceeded_limit(integrator, &medium(1e-4, 0.0), 1_000_000), None);
        }
    }

    #[test]
    fn euler_grows_with_the_length_of_the_run() {
        assert_eq!(exceeded_limit(Integrator::Euler, &medium(1e-4, 0.0), 100), None);
        assert!(exceeded_limit(Integrator::Euler, &medium(1e-4, 0.0), 10_000).is_some_and(|limit| limit < 2e-5));
        assert_eq!(exceeded_limit(Integrator::RungeKutta2, &medium(1e-4, 0.0), 10_000), None);
        assert!(exceeded_limit(Integrator::Midpoint, &medium(1e-3, 0.0), 100).is_some());
    }
}
