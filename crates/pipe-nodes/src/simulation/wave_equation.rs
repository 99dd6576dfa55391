//! `WaveEquation`: waves on a grid, by seven integrators.

use pipe_graph::node::scalar;
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::energy;
use super::implicit::Solver;
use super::stability::exceeded_limit;
use super::state::{begin, channels, leave};
use super::wave::{Boundary, Medium, in_blocks};
use super::wave_twin::{Grid64, step};
use crate::shader;

/// Solves ∂u/∂t = v, ∂v/∂t = c²∇²u − damping·v for `steps` steps of `dt`, with the 5-point ∇² on a grid of
/// spacing `dx`. The result has R = u, G = v and as many channels as the state, two at least; of four B = 0, A = 1.
///
/// `Euler`, `Midpoint` and `RungeKutta2` gain energy, `BackwardEuler` loses it; `SymplecticEuler`, `Verlet` and
/// `CrankNicolson` keep it. A `dt` that an explicit integrator does not bear is a warning that tells the limit.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct WaveEquation {
    /// R = u, G = v; a 1-channel image is u at rest.
    state: In<Image>,
    /// Time steps.
    #[default = 100]
    #[schemars(range(min = 0, max = 100_000_000))]
    steps: u32,
    /// Length of a time step.
    #[default = 0.0001]
    #[schemars(extend("exclusiveMinimum" = 0.0, "x-unit" = "s"))]
    dt: f32,
    /// Distance between pixels.
    #[default = 0.01]
    #[schemars(extend("exclusiveMinimum" = 0.0, "x-unit" = "m"))]
    dx: f32,
    /// Square of the wave's speed.
    #[default = 20.0]
    #[schemars(range(min = 0.0), extend("x-unit" = "m²/s²"))]
    c2: f32,
    /// How time is discretised.
    integrator: Integrator,
    /// What lies outside the grid.
    boundary: Boundary,
    /// Share of its velocity that a pixel loses in a unit of time.
    #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
    damping: f32,
    /// How far an implicit step is solved: what is left of the error of its first guess (the velocity before).
    #[default = 1e-6]
    #[schemars(range(min = 1e-9, max = 0.1))]
    tolerance: f32,
}

/// How time is discretised.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) enum Integrator {
    /// Explicit Euler: u⁺ = u + dt·v, v⁺ = v + dt·(c²∇²u − γv).
    Euler,
    /// The new velocity moves u: u⁺ = u + dt·v⁺.
    #[default]
    SymplecticEuler,
    /// The slope half a step ahead.
    Midpoint,
    /// Heun's method: the mean of the slopes at both ends.
    RungeKutta2,
    /// Velocity form: u⁺ = u + dt·v + dt²/2·a, v⁺ = v + dt/2·(a + a⁺).
    Verlet,
    /// The slope at the end; stable at any `dt`.
    BackwardEuler,
    /// The mean of the slopes at both ends, implicitly; stable at any `dt`.
    CrankNicolson,
}

pub(crate) const KIND: Kind = Kind::of::<WaveEquation>(
    "WaveEquation",
    Category::Simulation,
    &[
        r#"WaveEquation(state: "pair", steps: 10)"#,
        r#"WaveEquation(state: "in", steps: 20, dt: 0.3, dx: 1, c2: 1, integrator: SymplecticEuler, boundary: Periodic)"#,
        r#"WaveEquation(state: "grey", steps: 20, dt: 0.3, dx: 1, c2: 1, boundary: Absorbing)"#,
        r#"WaveEquation(state: "pair", steps: 20, dt: 0.1, dx: 1, c2: 2, integrator: Euler, boundary: Dirichlet)"#,
        r#"WaveEquation(state: "pair", steps: 9, dt: 0.1, dx: 1, c2: 1, integrator: Euler, boundary: Absorbing, damping: 0.5)"#,
        r#"WaveEquation(state: "pair", steps: 10, dt: 0.2, dx: 1, c2: 1, integrator: Midpoint, boundary: Absorbing)"#,
        r#"WaveEquation(state: "pair", steps: 10, dt: 0.2, dx: 1, c2: 1, integrator: Midpoint, boundary: Neumann, damping: 0.3)"#,
        r#"WaveEquation(state: "pair", steps: 10, dt: 0.2, dx: 1, c2: 1, integrator: RungeKutta2, boundary: Dirichlet, damping: 0.3)"#,
        r#"WaveEquation(state: "pair", steps: 10, dt: 0.2, dx: 1, c2: 1, integrator: RungeKutta2, boundary: Absorbing)"#,
        r#"WaveEquation(state: "pair", steps: 1, dt: 0.4, dx: 1, c2: 1, integrator: Verlet, boundary: Dirichlet)"#,
        r#"WaveEquation(state: "pair", steps: 20, dt: 0.4, dx: 1, c2: 1, integrator: Verlet, boundary: Absorbing, damping: 0.2)"#,
        r#"WaveEquation(state: "pair", steps: 20, dt: 0.4, dx: 1, c2: 1, integrator: Verlet, boundary: Periodic)"#,
        r#"WaveEquation(state: "pair", steps: 3, dt: 0.5, dx: 1, c2: 1, integrator: BackwardEuler)"#,
        r#"WaveEquation(state: "pair", steps: 3, dt: 2, dx: 1, c2: 1, integrator: BackwardEuler, boundary: Periodic, damping: 0.2)"#,
        r#"WaveEquation(state: "in", steps: 3, dt: 2, dx: 1, c2: 1, integrator: CrankNicolson, boundary: Dirichlet)"#,
        r#"WaveEquation(state: "pair", steps: 4, dt: 0.5, dx: 1, c2: 1, integrator: CrankNicolson, boundary: Absorbing, damping: 0.2)"#,
        r#"WaveEquation(state: "pair", steps: 0)"#,
        r#"WaveEquation(state: "in", steps: 0)"#,
    ],
)
.ports(&[("out", "R = u, G = v after the last step"), ("energy", "½∫v² + ½c²∫|∇u|² over the grid, after the last step")])
// Relative to the largest velocities: rounding of u is multiplied by c²·dt/dx² in each step.
.tolerance(1e-3, 1e-4);

impl WaveEquation {
    const fn medium(&self) -> Medium {
        Medium { dt: self.dt, dx: self.dx, c2: self.c2, damping: self.damping, boundary: self.boundary }
    }

    /// θ of an implicit integrator.
    const fn theta(&self) -> Option<f64> {
        match self.integrator {
            Integrator::BackwardEuler => Some(1.0),
            Integrator::CrankNicolson => Some(0.5),
            _ => None,
        }
    }

    fn solver(&self, theta: f64, size: [u32; 2]) -> Solver {
        Solver::new(theta, &self.medium(), size, f64::from(self.tolerance))
    }

    /// `count` explicit steps from `state`.
    fn stepped(&self, cx: &mut Lowering<'_>, count: u32, state: ResourceId) -> Result<ResourceId, Mistake> {
        let medium = self.medium();
        in_blocks(cx, "steps", count, state, |cx, [state, next], steps| {
            if steps > 1 {
                medium
                    .blocked_pass(cx, "steps", &shader!("simulation/wave_blocked"), steps, [state, next])
                    .constant("METHOD", self.integrator as i32)
                    .add();
            } else if self.integrator == Integrator::Verlet {
                self.verlet_stage(cx, "step", 1, state, next);
            } else {
                let shader = shader!("simulation/wave_explicit");
                medium.pass(cx, "step", &shader, state).write("out", next).constant("METHOD", self.integrator as i32).add();
            }
        })
    }

    fn verlet(&self, cx: &mut Lowering<'_>, state: ResourceId) -> Result<ResourceId, Mistake> {
        let shape = cx.shape(state);
        let ahead = cx.intermediate("start", shape);
        self.verlet_stage(cx, "start", 0, state, ahead);
        let almost = self.stepped(cx, self.steps - 1, ahead)?;
        let end = cx.intermediate("end", shape);
        self.verlet_stage(cx, "end", 2, almost, end);
        Ok(end)
    }

    fn verlet_stage(&self, cx: &mut Lowering<'_>, suffix: &str, stage: i32, state: ResourceId, next: ResourceId) {
        self.medium().pass(cx, suffix, &shader!("simulation/wave_verlet"), state).write("out", next).constant("STAGE", stage).add();
    }

    fn implicit(&self, cx: &mut Lowering<'_>, theta: f64, state: ResourceId) -> Result<ResourceId, Mistake> {
        let medium = self.medium();
        let shape = cx.shape(state);
        let size = cx.image_of(state).size;
        let solver = self.solver(theta, size);
        let theta = theta as f32;
        let result = cx.repeat("", Count::Fixed(self.steps), &[state], |cx, states| {
            let (rhs, guess) = (cx.intermediate("rhs", Shape::image(size, 1)), cx.intermediate("guess", shape));
            medium
                .pass(cx, "rhs", &shader!("simulation/wave_rhs"), states[0])
                .entry(Entry::Each)
                .write("rhs", rhs)
                .write("guess", guess)
                .param("theta", theta)
                .add();
            let solution = in_blocks(cx, "solve", solver.iterations, guess, |cx, [pair, next], steps| {
                let pass = if steps > 1 {
                    let shader = shader!("simulation/relax_blocked");
                    let border = medium.boundary.border();
                    medium.blocked_pass(cx, "relax", &shader, steps, [pair, next]).read_with(
                        "rhs",
                        rhs,
                        Reach::Around(steps, steps),
                        border,
                        Filter::Nearest,
                    )
                } else {
                    medium.pass(cx, "relax", &shader!("simulation/wave_relax"), pair).read("rhs", rhs, Reach::Point).write("out", next)
                };
                pass.param("theta", theta).param("gain", solver.gain as f32).param("inertia", solver.inertia as f32).add();
            })?;
            let next = cx.intermediate("next", shape);
            cx.pass("finish", shader!("simulation/wave_finish"))
                .entry(Entry::Point)
                .read("state", states[0], Reach::Point)
                .read("solution", solution, Reach::Point)
                .write("out", next)
                .param("theta", theta)
                .param("dt", self.dt)
                .add();
            Ok(vec![next])
        })?;
        Ok(result[0])
    }
}

impl Node for WaveEquation {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let state = inputs.image(&self.state);
        let medium = self.medium();
        if let Some(theta) = self.theta() {
            let iterations = self.solver(theta, state.size).iterations;
            if iterations > 1000 {
                inputs.warn(
                    Mistake::in_field("dt", format!("each step takes {iterations} iterations of the solver"))
                        .hint("a smaller `dt` or a larger `tolerance` is cheaper"),
                );
            }
        } else if let Some(limit) = exceeded_limit(self.integrator, &medium, self.steps) {
            let hint = match self.integrator {
                Integrator::SymplecticEuler | Integrator::Verlet => {
                    format!("expected at most {limit:.6}; `BackwardEuler` and `CrankNicolson` are stable at any `dt`")
                }
                _ => format!(
                    "at most {limit:.6} keeps the fastest wave of {} steps from growing tenfold; `SymplecticEuler` and `Verlet` do not grow",
                    self.steps
                ),
            };
            let message = format!("{} is beyond the stability limit of `{:?}`, {limit:.6}", self.dt, self.integrator);
            inputs.warn(Mistake::in_field("dt", message).hint(hint));
        }
        Ok(vec![Output::new("out", EdgeType::image(state.size, channels(state.channels))), Output::new("energy", scalar(1))])
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.state);
        let state = begin(cx, image);
        let end = match (self.steps, self.integrator, self.theta()) {
            (0, ..) => state,
            (_, Integrator::Verlet, _) => self.verlet(cx, state)?,
            (_, _, Some(theta)) => self.implicit(cx, theta, state)?,
            _ => self.stepped(cx, self.steps, state)?,
        };
        leave(cx, end, channels(cx.image_of(image).channels));
        let out = cx.output("energy");
        energy::lower(cx, &self.medium(), end, out);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.state);
        let grid = Grid64 { size: image.size, medium: self.medium() };
        let mut u: Vec<f64> = image.pixels.iter().map(|p| p[0]).collect();
        let mut v: Vec<f64> = image.pixels.iter().map(|p| if image.channels == 1 { 0.0 } else { p[1] }).collect();
        for _ in 0..self.steps {
            (u, v) = step(&grid, self.integrator, &u, &v);
        }
        let energy = grid.energy(&u, &v);
        let pixels = u.into_iter().zip(v).map(|(u, v)| [u, v, 0.0, 1.0]).collect();
        vec![Tensor::Image(Raster { size: image.size, channels: channels(image.channels), pixels }), Tensor::Scalar(vec![energy])]
    }
}
