//! Phase functions: the density of directions that light takes when it is scattered, per steradian, by the cosine μ of
//! the angle between its old and its new direction.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use pipe_graph::prelude::*;

/// Where light goes when it is scattered.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub(super) enum Phase {
    /// Everywhere alike: 1/4π.
    #[default]
    Isotropic,
    /// By particles much smaller than the wavelength: 3/16π·(1 + μ²).
    Rayleigh,
    /// (1 − g²)/(4π·(1 + g² − 2gμ)^3/2) of L. Henyey and J. Greenstein 1941.
    HenyeyGreenstein {
        /// Mean cosine: above 0 forward, below 0 backward.
        g: f32,
    },
}

impl Phase {
    /// What is wrong with its numbers.
    pub(super) fn check(self) -> Result<(), Mistake> {
        match self {
            Self::HenyeyGreenstein { g } if !(-0.999..=0.999).contains(&g) => {
                Err(Mistake::in_field("phase", format!("g is {g}")).hint("expected -0.999 to 0.999"))
            }
            _ => Ok(()),
        }
    }

    /// Its number in `lib/phase.wgsl`.
    pub(super) const fn code(self) -> i32 {
        match self {
            Self::Isotropic => 0,
            Self::Rayleigh => 1,
            Self::HenyeyGreenstein { .. } => 2,
        }
    }

    /// Its mean cosine.
    pub(super) const fn g(self) -> f32 {
        match self {
            Self::HenyeyGreenstein { g } => g,
            _ => 0.0,
        }
    }

    /// The density at this cosine, per steradian.
    pub(super) fn density(self, cosine: f64) -> f64 {
        match self {
            Self::Isotropic => 1.0 / (4.0 * PI),
            Self::Rayleigh => 3.0 / (16.0 * PI) * (1.0 + cosine * cosine),
            Self::HenyeyGreenstein { g } => {
                let g = f64::from(g);
                (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5))
            }
        }
    }

    /// The cosine below which the share `u` of scattered light lies.
    pub(super) fn cosine(self, u: f64) -> f64 {
        match self {
            Self::Isotropic => 2.0 * u - 1.0,
            // The root of μ³ + 3μ = 8u − 4, by Cardano.
            Self::Rayleigh => {
                let half = 4.0 * u - 2.0;
                let root = (half.abs() + (half * half + 1.0).sqrt()).cbrt();
                (root - 1.0 / root).copysign(half)
            }
            Self::HenyeyGreenstein { g: 0.0 } => 2.0 * u - 1.0,
            Self::HenyeyGreenstein { g } => {
                let g = f64::from(g);
                let inner = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
                (1.0 + g * g - inner * inner) / (2.0 * g)
            }
        }
    }

    /// The direction of light that came along `direction` and is scattered: `u` is the share of directions with smaller
    /// cosines, `turn` the angle around the old direction in turns.
    pub(super) fn scatter(self, direction: DVec3, u: f64, turn: f64) -> DVec3 {
        let cosine = self.cosine(u).clamp(-1.0, 1.0);
        let sine = (1.0 - cosine * cosine).sqrt();
        let (s, c) = (TAU * turn).sin_cos();
        let [tangent, bitangent] = basis(direction);
        (sine * c * tangent + sine * s * bitangent + cosine * direction).normalize()
    }
}

/// Two directions perpendicular to a unit vector and to each other (T. Duff et al., Building an Orthonormal Basis,
/// Revisited, 2017).
fn basis(n: DVec3) -> [DVec3; 2] {
    let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Phase; 5] = [
        Phase::Isotropic,
        Phase::Rayleigh,
        Phase::HenyeyGreenstein { g: 0.75 },
        Phase::HenyeyGreenstein { g: -0.4 },
        Phase::HenyeyGreenstein { g: 0.0 },
    ];

    /// ∫ f(μ)·p(μ)·2π dμ from −1 to `to`, by the midpoint rule.
    fn integral(phase: Phase, to: f64, f: impl Fn(f64) -> f64) -> f64 {
        let n = 200_000;
        let step = (to + 1.0) / f64::from(n);
        (0..n).map(|i| -1.0 + (f64::from(i) + 0.5) * step).map(|mu| f(mu) * phase.density(mu) * TAU * step).sum()
    }

    #[test]
    fn densities_integrate_to_one_and_have_the_mean_cosine_g() {
        for phase in ALL {
            assert!((integral(phase, 1.0, |_| 1.0) - 1.0).abs() < 1e-6, "{phase:?}");
            assert!((integral(phase, 1.0, |mu| mu) - f64::from(phase.g())).abs() < 1e-6, "{phase:?}");
        }
    }

    #[test]
    fn cosines_are_quantiles_of_the_densities() {
        for phase in ALL {
            for u in [0.001, 0.2, 0.5, 0.77, 0.999] {
                assert!((integral(phase, phase.cosine(u), |_| 1.0) - u).abs() < 1e-6, "{phase:?} at {u}");
            }
        }
    }

    #[test]
    fn scattered_directions_have_the_chosen_angle() {
        for direction in [DVec3::Y, DVec3::NEG_Z, DVec3::new(0.6, -0.64, 0.48)] {
            for turn in [0.0, 0.3, 0.9] {
                let out = Phase::Rayleigh.scatter(direction, 0.3, turn);
                assert!((out.dot(direction) - Phase::Rayleigh.cosine(0.3)).abs() < 1e-12);
            }
        }
    }
}
