//! The damped wave equation on a grid: what `WaveEquation` and `WaveStep` share.
//!
//! ∂u/∂t = v, ∂v/∂t = c²∇²u − γv, with the 5-point ∇². One pixel of a state is (u, v). What lies outside the grid
//! is a ghost pixel: 0 (`Dirichlet`), the edge pixel (`Neumann`), the pixel of the other side (`Periodic`). An
//! `Absorbing` edge lets waves out by the first-order condition of Mur (1981, eq. 11; Engquist & Majda 1977):
//! ∂u/∂n = −(1/c)·∂u/∂t, that is a ghost of u − (dx/c)·v. Put into ∇² this is a `Neumann` edge whose pixels are
//! damped by c/dx more for each open side: linear, local, and right for every integrator.

use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;

use crate::shader;

/// What lies outside the grid.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) enum Boundary {
    /// u = 0: waves come back upside down.
    Dirichlet,
    /// The edge value repeated: waves come back upright.
    #[default]
    Neumann,
    /// The opposite edge.
    Periodic,
    /// Nothing: waves leave. Of those that meet the edge squarely almost nothing returns, of grazing ones some does.
    Absorbing,
}

impl Boundary {
    /// The border policy that reads ghost pixels.
    pub(super) const fn border(self) -> Border {
        match self {
            Self::Dirichlet => Border::Black,
            Self::Neumann | Self::Absorbing => Border::Clamp,
            Self::Periodic => Border::Repeat,
        }
    }
}

/// The numbers of the equation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Medium {
    pub(super) dt: f32,
    pub(super) dx: f32,
    pub(super) c2: f32,
    pub(super) damping: f32,
    pub(super) boundary: Boundary,
}

impl Medium {
    /// c²/dx²
    pub(super) fn stiffness(&self) -> f64 {
        f64::from(self.c2) / (f64::from(self.dx) * f64::from(self.dx))
    }

    /// Damping that one open side adds to a pixel.
    pub(super) fn opening(&self) -> f64 {
        if self.boundary == Boundary::Absorbing { f64::from(self.c2).sqrt() / f64::from(self.dx) } else { 0.0 }
    }

    /// A pass of the shader behind the text that it shares with others.
    fn pass_behind<'b, 'a>(
        &self,
        cx: &'b mut Lowering<'a>,
        suffix: &str,
        [shared, shader]: [&Shader; 2],
        reach: Reach,
        state: ResourceId,
    ) -> PassBuilder<'b, 'a> {
        let text = format!("{}\n{}", shared.source, shader.source);
        cx.pass(suffix, Shader::builtin(&shader.path, &text))
            .read_with("state", state, reach, self.boundary.border(), Filter::Nearest)
            .constant("ABSORBING", self.boundary == Boundary::Absorbing)
            .param("dt", self.dt)
            .param("stiffness", self.stiffness() as f32)
            .param("damping", self.damping)
            .param("opening", self.opening() as f32)
    }

    /// A pass that reads `state` around each pixel, by the ∇² of `stencil.wgsl`.
    pub(super) fn pass<'b, 'a>(&self, cx: &'b mut Lowering<'a>, suffix: &str, shader: &Shader, state: ResourceId) -> PassBuilder<'b, 'a> {
        self.pass_behind(cx, suffix, [&shader!("simulation/stencil"), shader], Reach::Around(1, 1), state)
    }

    /// A pass of `steps` steps at once, by the ∇² of `blocked.wgsl`; its output is `out`.
    pub(super) fn blocked_pass<'b, 'a>(
        &self,
        cx: &'b mut Lowering<'a>,
        suffix: &str,
        shader: &Shader,
        steps: u32,
        [state, out]: [ResourceId; 2],
    ) -> PassBuilder<'b, 'a> {
        let core = 64 - 2 * steps;
        self.pass_behind(cx, suffix, [&shader!("simulation/blocked"), shader], Reach::Around(steps, steps), state)
            .entry(Entry::Kernel)
            .grid(Grid::Blocks([core; 2]))
            .write("out", out)
            .constant("STEPS", steps as i32)
            .constant("FIXED", self.boundary == Boundary::Dirichlet)
            .constant("PERIODIC", self.boundary == Boundary::Periodic)
    }
}

/// Most steps that a GPU takes in one pass: each costs a ring of the 64×64 pixels that a workgroup holds, and spares a
/// round trip of the state through memory.
const BLOCK: u32 = 8;

/// Takes `count` steps from `state`, on a GPU in blocks. `step` declares a pass that takes some steps from a state to the
/// next.
pub(super) fn in_blocks<'a>(
    cx: &mut Lowering<'a>,
    suffix: &str,
    count: u32,
    state: ResourceId,
    step: impl Fn(&mut Lowering<'a>, [ResourceId; 2], u32),
) -> Result<ResourceId, Mistake> {
    let most = if cx.limits().profile == Profile::Gpu { BLOCK } else { 1 };
    let shape = cx.shape(state);
    let one = |cx: &mut Lowering<'a>, state: ResourceId, steps: u32| {
        let next = cx.intermediate("next", shape);
        step(cx, [state, next], steps);
        next
    };
    let mut state = state;
    for (steps, times) in [(most, count / most), (count % most, 1)] {
        state = match times {
            _ if steps == 0 || times == 0 => state,
            1 => one(cx, state, steps),
            _ => cx.repeat(suffix, Count::Fixed(times), &[state], |cx, states| Ok(vec![one(cx, states[0], steps)]))?[0],
        };
    }
    Ok(state)
}
