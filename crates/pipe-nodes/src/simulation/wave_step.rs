//! `WaveStep`: one pass of the wave equation, to be put together in an `Iterate`.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::wave::{Boundary, Medium};
use super::wave_twin::Grid64;
use crate::shader;

/// One pass of an explicit integrator of ∂u/∂t = v, ∂v/∂t = c²∇²u − damping·v. `Euler` is a whole step;
/// `MidpointHalf` writes the state half a step ahead beside the state (u, v, um, vm), and `MidpointFull` steps from
/// those four to the next (u, v):
///
/// `Iterate(state: {"s": "seed"}, body: {"half": WaveStep(state: "s", integrator: MidpointHalf), "full": WaveStep(state: "half", integrator: MidpointFull)}, next: {"s": "full"}, count: 100)`
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct WaveStep {
    /// R = u, G = v; `MidpointFull` also reads B = um, A = vm. `Euler` keeps the other channels; both midpoint
    /// passes write four.
    state: In<Image>,
    /// Length of the time step.
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
    /// Which pass.
    integrator: Method,
    /// What lies outside the grid.
    boundary: Boundary,
    /// Share of its velocity that a pixel loses in a unit of time.
    #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
    damping: f32,
}

/// Which pass.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Method {
    /// u⁺ = u + dt·v, v⁺ = v + dt·(c²∇²u − γv).
    #[default]
    Euler,
    /// um = u + dt/2·v, vm = v + dt/2·(c²∇²u − γv).
    MidpointHalf,
    /// u⁺ = u + dt·vm, v⁺ = v + dt·(c²∇²um − γvm).
    MidpointFull,
}

pub(crate) const KIND: Kind = Kind::of::<WaveStep>(
    "WaveStep",
    Category::Simulation,
    &[
        r#"WaveStep(state: "pair")"#,
        r#"WaveStep(state: "in", dt: 0.1, dx: 1, c2: 1, boundary: Dirichlet, damping: 0.5)"#,
        r#"WaveStep(state: "pair", dt: 0.1, dx: 1, c2: 1, integrator: MidpointHalf, boundary: Periodic)"#,
        r#"WaveStep(state: "in", dt: 0.1, dx: 1, c2: 1, integrator: MidpointFull, boundary: Absorbing)"#,
    ],
)
// Relative to the largest velocities: rounding of u is multiplied by c²·dt/dx².
.tolerance(1e-4, 1e-5);

impl WaveStep {
    const fn medium(&self) -> Medium {
        Medium { dt: self.dt, dx: self.dx, c2: self.c2, damping: self.damping, boundary: self.boundary }
    }

    fn channels(&self, state: u8) -> u8 {
        if self.integrator == Method::Euler { state } else { 4 }
    }
}

impl Node for WaveStep {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let state = inputs.image(&self.state);
        if state.channels == 1 {
            return Err(Mistake::in_field("state", "has one channel").hint("expected two (u, v) or four (u, v, um, vm)"));
        }
        if state.channels == 2 && self.integrator == Method::MidpointFull {
            return Err(Mistake::in_field("state", "has two channels").hint("expected four: the result of `MidpointHalf`"));
        }
        Ok(Output::out(EdgeType::image(state.size, self.channels(state.channels))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (state, out) = (cx.input(&self.state), cx.output("out"));
        self.medium()
            .pass(cx, "", &shader!("simulation/wave_step"), state)
            .write("out", out)
            .constant("METHOD", self.integrator as i32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let state = cx.image(&self.state);
        let grid = Grid64 { size: state.size, medium: self.medium() };
        let full = self.integrator == Method::MidpointFull;
        let u: Vec<f64> = state.pixels.iter().map(|p| if full { p[2] } else { p[0] }).collect();
        let h = f64::from(self.dt);
        let (bent, gamma) = (grid.curvature(&u), grid.damping());
        let pixels = state.pixels.iter().zip(bent.iter().zip(&gamma)).map(|(p, (l, g))| {
            let [u, v, um, vm] = *p;
            match self.integrator {
                Method::Euler => [u + h * v, v + h * (l - g * v), um, vm],
                Method::MidpointHalf => [u, v, u + h / 2.0 * v, v + h / 2.0 * (l - g * v)],
                Method::MidpointFull => [u + h * vm, v + h * (l - g * vm), um, vm],
            }
        });
        let channels = self.channels(state.channels);
        vec![Tensor::Image(Raster { size: state.size, channels, pixels: pixels.map(|p| narrow(p, channels)).collect() })]
    }
}
