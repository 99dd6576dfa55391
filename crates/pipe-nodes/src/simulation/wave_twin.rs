//! The twins of the wave nodes: each integrator in double precision, as its textbook writes it.

use pipe_graph::reference::border_index;

use super::wave::{Boundary, Medium};
use super::wave_equation::Integrator;

/// The twins' grid: values row by row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid64 {
    pub(super) size: [u32; 2],
    pub(super) medium: Medium,
}

impl Grid64 {
    /// Index of the pixel beside (x, y), if there is one.
    fn neighbour(&self, x: i64, y: i64) -> Option<usize> {
        let x = border_index(x, self.size[0], self.medium.boundary.border())?;
        let y = border_index(y, self.size[1], self.medium.boundary.border())?;
        Some(y * self.size[0] as usize + x)
    }

    fn pixels(&self) -> impl Iterator<Item = (i64, i64)> + use<> {
        let [w, h] = self.size.map(i64::from);
        (0..h).flat_map(move |y| (0..w).map(move |x| (x, y)))
    }

    /// c²∇²u, without what an absorbing edge adds.
    pub(super) fn curvature(&self, u: &[f64]) -> Vec<f64> {
        let value = |x, y| self.neighbour(x, y).map_or(0.0, |i| u[i]);
        let sum = |(x, y)| value(x - 1, y) + value(x + 1, y) + value(x, y - 1) + value(x, y + 1) - 4.0 * value(x, y);
        self.pixels().map(|at| self.medium.stiffness() * sum(at)).collect()
    }

    /// γ at each pixel.
    pub(super) fn damping(&self) -> Vec<f64> {
        let [w, h] = self.size.map(i64::from);
        let open = |(x, y): (i64, i64)| [x == 0, x == w - 1, y == 0, y == h - 1].into_iter().filter(|side| *side).count();
        self.pixels().map(|at| f64::from(self.medium.damping) + open(at) as f64 * self.medium.opening()).collect()
    }

    /// ½∫v² + ½c²∫|∇u|² over the grid, with the differences that the 5-point ∇² belongs to.
    pub(super) fn energy(&self, u: &[f64], v: &[f64]) -> f64 {
        let dx2 = f64::from(self.medium.dx).powi(2);
        let value = |x, y| self.neighbour(x, y).map_or(0.0, |i| u[i]);
        let mut sum: f64 = v.iter().map(|v| 0.5 * v * v * dx2).sum();
        let half = 0.5 * f64::from(self.medium.c2);
        for (x, y) in self.pixels() {
            let here = value(x, y);
            sum += half * ((value(x + 1, y) - here).powi(2) + (value(x, y + 1) - here).powi(2));
            // A fixed rim pulls at the left and top edge too.
            if self.medium.boundary == Boundary::Dirichlet {
                sum += half * here * here * f64::from(u8::from(x == 0) + u8::from(y == 0));
            }
        }
        sum
    }
}

/// a + k·b
fn plus(a: &[f64], k: f64, b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + k * b).collect()
}

/// One step.
pub(super) fn step(grid: &Grid64, integrator: Integrator, u: &[f64], v: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let h = f64::from(grid.medium.dt);
    let gamma = grid.damping();
    let slope = |u: &[f64], v: &[f64]| -> Vec<f64> { grid.curvature(u).iter().zip(v).zip(&gamma).map(|((l, v), g)| l - g * v).collect() };
    let a = slope(u, v);
    match integrator {
        Integrator::Euler => (plus(u, h, v), plus(v, h, &a)),
        Integrator::SymplecticEuler => {
            let v = plus(v, h, &a);
            (plus(u, h, &v), v)
        }
        Integrator::Midpoint => {
            let (um, vm) = (plus(u, h / 2.0, v), plus(v, h / 2.0, &a));
            (plus(u, h, &vm), plus(v, h, &slope(&um, &vm)))
        }
        Integrator::RungeKutta2 => {
            let (u1, v1) = (plus(u, h, v), plus(v, h, &a));
            let b = slope(&u1, &v1);
            (plus(u, h / 2.0, &plus(v, 1.0, &v1)), plus(v, h / 2.0, &plus(&a, 1.0, &b)))
        }
        Integrator::Verlet => {
            let u = plus(&plus(u, h, v), h * h / 2.0, &a);
            // a⁺ = c²∇²u⁺ − γv⁺ holds the v⁺ that is wanted.
            let pulled = plus(&plus(v, h / 2.0, &a), h / 2.0, &grid.curvature(&u));
            let v = pulled.iter().zip(&gamma).map(|(p, g)| p / (1.0 + h / 2.0 * g)).collect();
            (u, v)
        }
        Integrator::BackwardEuler => {
            // v⁺ = v + h·(c²∇²(u + h·v⁺) − γv⁺)
            let rhs = plus(v, h, &grid.curvature(u));
            let next = solve(&rhs, v, |x| plus(&damped(x, h, &gamma), -h * h, &grid.curvature(x)));
            (plus(u, h, &next), next)
        }
        Integrator::CrankNicolson => {
            // v⁺ = v + h/2·(a + c²∇²(u + h/2·(v + v⁺)) − γv⁺)
            let k = h / 2.0;
            let rhs = plus(&plus(v, k, &a), k, &grid.curvature(&plus(u, k, v)));
            let next = solve(&rhs, v, |x| plus(&damped(x, k, &gamma), -k * k, &grid.curvature(x)));
            (plus(u, k, &plus(v, 1.0, &next)), next)
        }
    }
}

/// (1 + k·γ)·x
fn damped(x: &[f64], k: f64, gamma: &[f64]) -> Vec<f64> {
    x.iter().zip(gamma).map(|(x, g)| x * (1.0 + k * g)).collect()
}

/// Conjugate gradients for a symmetric positive definite product, to the last digits.
fn solve(rhs: &[f64], guess: &[f64], product: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let mut x = guess.to_vec();
    let mut r = plus(rhs, -1.0, &product(&x));
    let mut p = r.clone();
    let mut rr = dot(&r, &r);
    let small = 1e-28 * dot(rhs, rhs);
    for _ in 0..10_000 {
        if rr <= small {
            break;
        }
        let ap = product(&p);
        let alpha = rr / dot(&p, &ap);
        x = plus(&x, alpha, &p);
        r = plus(&r, -alpha, &ap);
        let next = dot(&r, &r);
        p = plus(&r, next / rr, &p);
        rr = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// u at pixels 0 and 6, v at pixels 1 and 11 of a 4×3 grid after three steps, by NumPy: powers of each method's dense
    /// matrix, built from Kronecker blocks; the implicit ones by `numpy.linalg.inv`.
    #[test]
    #[rustfmt::skip]
    fn agrees_with_dense_matrices() {
        let expected: [(Boundary, f32, Integrator, [f64; 4]); 28] = [
            (Boundary::Neumann, 0.25, Integrator::Euler, [0.4498863636, 0.6018568182, -2.1977477273, 1.3509420455]),
            (Boundary::Neumann, 0.25, Integrator::SymplecticEuler, [0.4689434545, 0.4626922523, -0.6758801477, 0.7607281818]),
            (Boundary::Neumann, 0.25, Integrator::Midpoint, [0.4481999866, 0.4508511251, -0.7027451437, 0.6210151535]),
            (Boundary::Neumann, 0.25, Integrator::RungeKutta2, [0.4481999866, 0.4508511251, -0.7027451437, 0.6210151535]),
            (Boundary::Neumann, 0.25, Integrator::Verlet, [0.4170731812, 0.4959844466, -0.6886897720, 0.6194014072]),
            (Boundary::Neumann, 0.25, Integrator::BackwardEuler, [0.3384428132, 0.5471987701, -0.4691201319, 0.5144050966]),
            (Boundary::Neumann, 0.25, Integrator::CrankNicolson, [0.3980989339, 0.5246579041, -0.8818842670, 0.7299460966]),
            (Boundary::Dirichlet, 0.0, Integrator::Euler, [0.3854545455, 0.6208181818, -3.3063636364, 0.7638863636]),
            (Boundary::Dirichlet, 0.0, Integrator::SymplecticEuler, [0.2045594545, 0.3352167841, -1.0530909091, -0.1997190909]),
            (Boundary::Dirichlet, 0.0, Integrator::Midpoint, [0.2821418068, 0.3811222685, -1.0373250415, -0.4596943668]),
            (Boundary::Dirichlet, 0.0, Integrator::RungeKutta2, [0.2821418068, 0.3811222685, -1.0373250415, -0.4596943668]),
            (Boundary::Dirichlet, 0.0, Integrator::Verlet, [0.2361899545, 0.4133463466, -1.0412957098, -0.3556640993]),
            (Boundary::Dirichlet, 0.0, Integrator::BackwardEuler, [0.1283897092, 0.3636285501, -0.8138781301, -0.1102014651]),
            (Boundary::Dirichlet, 0.0, Integrator::CrankNicolson, [0.2284612533, 0.4336430910, -1.3434410846, -0.1204992876]),
            (Boundary::Periodic, 0.25, Integrator::Euler, [0.8250636364, 0.6018568182, -2.7628147727, 1.7105022727]),
            (Boundary::Periodic, 0.25, Integrator::SymplecticEuler, [0.6394789216, 0.4346829125, -0.4105029773, 0.0564067955]),
            (Boundary::Periodic, 0.25, Integrator::Midpoint, [0.7036320851, 0.4365250324, -0.3415597384, -0.2473629696]),
            (Boundary::Periodic, 0.25, Integrator::RungeKutta2, [0.7036320851, 0.4365250324, -0.3415597384, -0.2473629696]),
            (Boundary::Periodic, 0.25, Integrator::Verlet, [0.6275026279, 0.4789257369, -0.4808322204, -0.0127351692]),
            (Boundary::Periodic, 0.25, Integrator::BackwardEuler, [0.4622704649, 0.5192860769, -0.4265968454, 0.2869453204]),
            (Boundary::Periodic, 0.25, Integrator::CrankNicolson, [0.6059713357, 0.5066935501, -0.8057656036, 0.3255613925]),
            (Boundary::Absorbing, 0.0, Integrator::Euler, [0.3689051504, 0.6208181818, -1.5988403634, 0.3232495214]),
            (Boundary::Absorbing, 0.0, Integrator::SymplecticEuler, [0.2965280154, 0.4833620329, -0.3535227653, 0.1454352416]),
            (Boundary::Absorbing, 0.0, Integrator::Midpoint, [0.2926883375, 0.4538849615, -0.3997158455, 0.1911441504]),
            (Boundary::Absorbing, 0.0, Integrator::RungeKutta2, [0.2926883375, 0.4538849615, -0.3997158455, 0.1911441504]),
            (Boundary::Absorbing, 0.0, Integrator::Verlet, [0.2985886119, 0.5014323088, -0.4841514098, 0.2261820682]),
            (Boundary::Absorbing, 0.0, Integrator::BackwardEuler, [0.2475805512, 0.5442472883, -0.4098445791, 0.2761417248]),
            (Boundary::Absorbing, 0.0, Integrator::CrankNicolson, [0.2820814636, 0.5277845445, -0.6598913151, 0.2740685453]),
        ];
        let u0: Vec<f64> = (0..12).map(|i| f64::from((3 * i * i + 5 * i + 1) % 11) / 11.0).collect();
        let v0: Vec<f64> = (0..12).map(|i| f64::from((7 * i + 2) % 5) / 5.0 - 0.4).collect();
        for (boundary, damping, integrator, expected) in expected {
            let grid = Grid64 { size: [4, 3], medium: Medium { dt: 0.3, dx: 1.0, c2: 1.5, damping, boundary } };
            let (mut u, mut v) = (u0.clone(), v0.clone());
            for _ in 0..3 {
                (u, v) = step(&grid, integrator, &u, &v);
            }
            for (got, expected) in [u[0], u[6], v[1], v[11]].into_iter().zip(expected) {
                // dt is 0.3 in 32 bits.
                assert!((got - expected).abs() < 1e-6, "{integrator:?}, {boundary:?}: {got}, expected {expected}");
            }
        }
    }

    #[test]
    fn symplectic_steps_keep_the_energy() {
        let medium = Medium { dt: 0.1, dx: 1.0, c2: 1.0, damping: 0.0, boundary: Boundary::Dirichlet };
        let grid = Grid64 { size: [9, 7], medium };
        let u0: Vec<f64> = (0..63).map(|i| f64::from(i * i % 17) / 17.0).collect();
        let before = grid.energy(&u0, &[0.0; 63]);
        for (integrator, drift) in [(Integrator::Verlet, 0.01), (Integrator::CrankNicolson, 1e-10)] {
            let (mut u, mut v) = (u0.clone(), vec![0.0; 63]);
            for _ in 0..200 {
                (u, v) = step(&grid, integrator, &u, &v);
            }
            assert!((grid.energy(&u, &v) / before - 1.0).abs() < drift, "{integrator:?}");
        }
    }
}
