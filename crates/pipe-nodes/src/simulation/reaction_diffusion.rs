//! `ReactionDiffusion`: spots, stripes and corals.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::state::{channels, leave, widened};
use crate::shader;

/// The Gray–Scott model: ∂U/∂t = Du·∇²U − U·V² + F·(1 − U), ∂V/∂t = Dv·∇²V + U·V² − (F + k)·V, by explicit steps of `dt`
/// with the 5-point ∇² on pixels of side 1 (Pearson, Complex Patterns in a Simple System, Science 261, 1993). The
/// result has R = U, G = V and as many channels as the image, two at least; of four B = 0, A = 1. Patterns need some thousand
/// steps. `options.border` is the rim: `Clamp` insulates, `Repeat` is periodic.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct ReactionDiffusion {
    /// R = U, G = V, concentrations in 0..1; of a 1-channel image U = 1 − value, V = value.
    image: In<Image>,
    /// Time steps.
    #[default = 100]
    #[schemars(range(min = 0, max = 100_000_000))]
    steps: u32,
    /// Feed rate.
    #[serde(rename = "F", alias = "f")]
    #[default = 0.035]
    #[schemars(range(min = 0.0, max = 1.0))]
    feed: f32,
    /// Kill rate.
    #[default = 0.065]
    #[schemars(range(min = 0.0, max = 1.0))]
    k: f32,
    /// Diffusivity of U.
    #[serde(rename = "Du", alias = "du")]
    #[default = 0.16]
    #[schemars(range(min = 0.0), extend("x-unit" = "px²/s"))]
    du: f32,
    /// Diffusivity of V.
    #[serde(rename = "Dv", alias = "dv")]
    #[default = 0.08]
    #[schemars(range(min = 0.0), extend("x-unit" = "px²/s"))]
    dv: f32,
    /// Length of a time step; stable up to 1/(4·Du).
    #[default = 1.0]
    #[schemars(extend("exclusiveMinimum" = 0.0, "x-unit" = "s"))]
    dt: f32,
}

pub(crate) const KIND: Kind = Kind::of::<ReactionDiffusion>(
    "ReactionDiffusion",
    Category::Simulation,
    &[
        r#"ReactionDiffusion(image: "grey", steps: 10, dt: 0.01)"#,
        r#"ReactionDiffusion(image: "pair", steps: 8, F: 0.055, k: 0.062, Du: 0.2, Dv: 0.1, dt: 0.01)"#,
        r#"ReactionDiffusion(image: "in", steps: 1, dt: 0.1)"#,
        r#"ReactionDiffusion(image: "in", steps: 0)"#,
    ],
)
.tolerance(1e-5, 1e-4);

impl Node for ReactionDiffusion {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let fastest = self.du.max(self.dv);
        if fastest * self.dt > 0.25 {
            let limit = 0.25 / fastest;
            inputs.warn(
                Mistake::in_field("dt", format!("{} is beyond the stability limit, {limit}", self.dt))
                    .hint(format!("expected at most {limit}")),
            );
        }
        let image = inputs.image(&self.image);
        Ok(Output::out(EdgeType::image(image.size, channels(image.channels))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        let ty = cx.image_of(image);
        let state = if ty.channels == 2 {
            widened(cx, image)
        } else {
            let state = cx.intermediate("begin", Shape::image(ty.size, 2));
            cx.pass("begin", shader!("simulation/reaction_begin"))
                .entry(Entry::Point)
                .read("image", image, Reach::Point)
                .write("out", state)
                .constant("SEED", ty.channels == 1)
                .add();
            state
        };
        if self.steps == 0 {
            leave(cx, state, channels(ty.channels));
            return Ok(());
        }
        let shape = cx.shape(state);
        let end = cx.repeat("", Count::Fixed(self.steps), &[state], |cx, states| {
            let next = cx.intermediate("next", shape);
            cx.pass("step", shader!("simulation/reaction_diffusion"))
                .read("state", states[0], Reach::Around(1, 1))
                .write("out", next)
                .param("feed", self.feed)
                .param("kill", self.k)
                .param("diffusivity", [self.du, self.dv])
                .param("dt", self.dt)
                .add();
            Ok(vec![next])
        })?;
        leave(cx, end[0], channels(ty.channels));
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let grey = image.channels == 1;
        let mut s = image.map(2, |p| if grey { [1.0 - p[0], p[0], 0.0, 1.0] } else { p });
        let [feed, kill, du, dv, dt] = [self.feed, self.k, self.du, self.dv, self.dt].map(f64::from);
        for _ in 0..self.steps {
            let bent = |x: i64, y: i64, i: usize| {
                let load = |x, y| s.load(x, y, cx.border)[i];
                load(x - 1, y) + load(x + 1, y) + load(x, y - 1) + load(x, y + 1) - 4.0 * load(x, y)
            };
            s = Raster::from_fn(s.size, 2, |x, y| {
                let [u, v, ..] = s.at(x, y);
                let reacted = u * v * v;
                let du_dt = du * bent(x, y, 0) - reacted + feed * (1.0 - u);
                let dv_dt = dv * bent(x, y, 1) + reacted - (feed + kill) * v;
                [u + dt * du_dt, v + dt * dv_dt, 0.0, 1.0]
            });
        }
        vec![Tensor::Image(Raster { channels: channels(image.channels), ..s })]
    }
}
