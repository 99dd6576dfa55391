//! The damped wave equation on a grid: what `WaveEquation` and `WaveStep` share.
//!
//! ∂u/∂t = v, ∂v/∂t = c²∇²u − γv, with the 5-point ∇². One pixel of a state is (u, v). What lies outside the grid
//! is a ghost pixel: 0 (`Dirichlet`), the edge pixel (`Neumann`), the pixel of the other side (`Periodic`). An
//! `Absorbing` edge lets waves out by the first-order condition of Mur (1981, eq. 11; Engquist & Majda 1977):
//! ∂u/∂n = −(1/c)·∂u/∂t, that is a ghost of u − (dx/c)·v. Put into ∇² this is a `Neumann` edge whose pixels are
//! damped by c/dx more for each open side: linear, local, and right for every integrator.

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

    /// A shader of this section behind the ∇² that they share, with its parameters. It reads `state`.
    pub(super) fn pass<'b, 'a>(
        &self,
        cx: &'b mut Lowering<'a>,
        suffix: &str,
        shader: &Shader,
        state: ResourceId,
    ) -> pipe_graph::lowering::PassBuilder<'b, 'a> {
        let stencil = crate::shader!("simulation/stencil");
        let text = format!("{}\n{}", stencil.source, shader.source);
        cx.pass(suffix, Shader::builtin(&shader.path, &text))
            .read_with("state", state, Reach::Around(1, 1), self.boundary.border(), Filter::Nearest)
            .constant("ABSORBING", self.boundary == Boundary::Absorbing)
            .param("dt", self.dt)
            .param("stiffness", self.stiffness() as f32)
            .param("damping", self.damping)
            .param("opening", self.opening() as f32)
    }
}

/// The twins' grid: values row by row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid64 {
    pub(super) size: [u32; 2],
    pub(super) medium: Medium,
}

impl Grid64 {
    /// Index of the pixel beside (x, y), if there is one.
    fn neighbour(&self, x: i64, y: i64) -> Option<usize> {
        let x = pipe_graph::reference::border_index(x, self.size[0], self.medium.boundary.border())?;
        let y = pipe_graph::reference::border_index(y, self.size[1], self.medium.boundary.border())?;
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
