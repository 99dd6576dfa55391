//! `HeatDiffusion`: the heat equation on a grid.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::state::widened;
use crate::shader;

/// Solves ∂T/∂t = alpha·∇²T for `steps` explicit steps of `dt`, in every channel (alpha too: colours are associated),
/// with the 5-point ∇² on pixels of side 1. After a time t a point is a Gaussian of σ = √(2·alpha·t) pixels.
/// `options.border` is the rim: `Clamp` insulates, `Black` is held at 0, `Repeat` is periodic.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct HeatDiffusion {
    /// The temperature to begin with.
    image: In<Image>,
    /// Time steps.
    #[default = 100]
    #[schemars(range(min = 0, max = 100_000_000))]
    steps: u32,
    /// Diffusivity.
    #[default = 1.0]
    #[schemars(range(min = 0.0), extend("x-unit" = "px²/s"))]
    alpha: f32,
    /// Length of a time step; stable up to 1/(4·alpha).
    #[default = 0.2]
    #[schemars(extend("exclusiveMinimum" = 0.0, "x-unit" = "s"))]
    dt: f32,
}

pub(crate) const KIND: Kind = Kind::of::<HeatDiffusion>(
    "HeatDiffusion",
    Category::Simulation,
    &[
        r#"HeatDiffusion(image: "in", steps: 10)"#,
        r#"HeatDiffusion(image: "grey", steps: 100, alpha: 0.5, dt: 0.4)"#,
        r#"HeatDiffusion(image: "pair", steps: 0)"#,
    ],
)
.tolerance(1e-5, 1e-5);

impl HeatDiffusion {
    fn rate(&self) -> f32 {
        self.alpha * self.dt
    }
}

impl Node for HeatDiffusion {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        if self.rate() > 0.25 {
            let limit = 0.25 / self.alpha;
            inputs.warn(
                Mistake::in_field("dt", format!("{} is beyond the stability limit, {limit}", self.dt))
                    .hint(format!("expected at most {limit}")),
            );
        }
        let image = inputs.image(&self.image);
        Ok(Output::out(EdgeType::image(image.size, image.channels)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        let image = widened(cx, image);
        let shape = cx.shape(image);
        if self.steps == 0 {
            cx.emit("out", image);
            return Ok(());
        }
        let end = cx.repeat("", Count::Fixed(self.steps), &[image], |cx, states| {
            let next = cx.intermediate("next", shape);
            cx.pass("step", shader!("simulation/heat_diffusion"))
                .read("image", states[0], Reach::Around(1, 1))
                .write("out", next)
                .param("rate", self.rate())
                .add();
            Ok(vec![next])
        })?;
        cx.emit("out", end[0]);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let mut t = cx.image(&self.image).clone();
        let rate = f64::from(self.alpha) * f64::from(self.dt);
        for _ in 0..self.steps {
            let load = |x, y| t.load(x, y, cx.border);
            t = Raster::from_fn(t.size, t.channels, |x, y| {
                let (l, r, u, d, c) = (load(x - 1, y), load(x + 1, y), load(x, y - 1), load(x, y + 1), load(x, y));
                std::array::from_fn(|i| c[i] + rate * (l[i] + r[i] + u[i] + d[i] - 4.0 * c[i]))
            });
        }
        vec![Tensor::Image(t)]
    }
}
