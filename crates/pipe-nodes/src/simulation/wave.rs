//! The damped wave equation on a grid: what `WaveEquation` and `WaveStep` share.
//!
//! ∂u/∂t = v, ∂v/∂t = c²∇²u − γv, with the 5-point ∇². One pixel of a state is (u, v). What lies outside the grid
//! is a ghost pixel: 0 (`Dirichlet`), the edge pixel (`Neumann`), the pixel of the other side (`Periodic`). An
//! `Absorbing` edge lets waves out by the first-order condition of Mur (1981, eq. 11; Engquist & Majda 1977):
//! ∂u/∂n = −(1/c)·∂u/∂t, that is a ghost of u − (dx/c)·v. Put into ∇² this is a `Neumann` edge whose pixels are
//! damped by c/dx more for each open side: linear, local, and right for every integrator.

use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;

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

    /// A pass of a shader of this section that reads `state`, with the parameters that they share.
    pub(super) fn bare_pass<'b, 'a>(
        &self,
        cx: &'b mut Lowering<'a>,
        suffix: &str,
        shader: Shader,
        reach: Reach,
        state: ResourceId,
    ) -> PassBuilder<'b, 'a> {
        cx.pass(suffix, shader)
            .read_with("state", state, reach, self.boundary.border(), Filter::Nearest)
            .constant("ABSORBING", self.boundary == Boundary::Absorbing)
            .param("dt", self.dt)
            .param("stiffness", self.stiffness() as f32)
            .param("damping", self.damping)
            .param("opening", self.opening() as f32)
    }

    /// The same of a shader that stands behind the ∇² of `stencil.wgsl`.
    pub(super) fn pass<'b, 'a>(
        &self,
        cx: &'b mut Lowering<'a>,
        suffix: &str,
        shader: &Shader,
        state: ResourceId,
    ) -> PassBuilder<'b, 'a> {
        let stencil = crate::shader!("simulation/stencil");
        let text = format!("{}\n{}", stencil.source, shader.source);
        self.bare_pass(cx, suffix, Shader::builtin(&shader.path, &text), Reach::Around(1, 1), state)
    }
}
