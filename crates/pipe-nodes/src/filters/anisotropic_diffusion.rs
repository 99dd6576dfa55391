//! `AnisotropicDiffusion`: heat that does not cross edges.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;
use crate::simulation::state::widened;

/// Diffuses within regions and hardly across edges: in each iteration
/// I += dt·Σ c(∇I)·∇I over the four neighbours, c(s) = 1/(1 + (s/κ)²)
/// (P. Perona and J. Malik, Scale-Space and Edge Detection Using Anisotropic Diffusion, 1990, the second of their functions).
///
/// Every channel by itself, alpha too. `options.border` is the rim: `Clamp` and `Mirror` let nothing through.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct AnisotropicDiffusion {
    /// The image.
    image: In<Image>,
    /// How often.
    #[default = 20]
    #[schemars(range(min = 0, max = 1_000_000))]
    iterations: u32,
    /// κ: differences between neighbours well above it are edges.
    #[default = 0.1]
    #[schemars(range(min = 1e-6, max = 1e6))]
    kappa: f32,
    /// Length of a step; stable up to 1/4.
    #[default = 0.2]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    dt: f32,
}

pub(super) const KIND: Kind = Kind::of::<AnisotropicDiffusion>(
    "AnisotropicDiffusion",
    Category::Filters,
    &[
        r#"AnisotropicDiffusion(image: "in")"#,
        r#"AnisotropicDiffusion(image: "grey", iterations: 7, kappa: 0.5, dt: 0.25)"#,
        r#"AnisotropicDiffusion(image: "pair", iterations: 1)"#,
        r#"AnisotropicDiffusion(image: "in", iterations: 0)"#,
    ],
)
.tolerance(2e-5, 1e-5);

impl Node for AnisotropicDiffusion {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        if self.dt > 0.25 {
            inputs.warn(Mistake::in_field("dt", format!("{} is beyond the stability limit, 0.25", self.dt)).hint("expected at most 0.25"));
        }
        let image = inputs.image(&self.image);
        Ok(Output::out(EdgeType::image(image.size, image.channels)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        let image = widened(cx, image);
        if self.iterations == 0 {
            cx.emit("out", image);
            return Ok(());
        }
        let shape = cx.shape(image);
        let end = cx.repeat("", Count::Fixed(self.iterations), &[image], |cx, states| {
            let next = cx.intermediate("next", shape);
            cx.pass("step", shader!("filters/anisotropic_diffusion"))
                .read("image", states[0], Reach::Around(1, 1))
                .write("out", next)
                .param("kappa", self.kappa)
                .param("dt", self.dt)
                .add();
            Ok(vec![next])
        })?;
        cx.emit("out", end[0]);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (kappa, dt) = (f64::from(self.kappa), f64::from(self.dt));
        let mut image = cx.image(&self.image).clone();
        for _ in 0..self.iterations {
            image = Raster::from_fn(image.size, image.channels, |x, y| {
                let here = image.at(x, y);
                let around = [(-1, 0), (1, 0), (0, -1), (0, 1)].map(|(dx, dy)| image.load(x + dx, y + dy, cx.border));
                std::array::from_fn(|c| {
                    let flow = |p: &[f64; 4]| {
                        let s = p[c] - here[c];
                        s / (1.0 + (s / kappa).powi(2))
                    };
                    here[c] + dt * around.iter().map(flow).sum::<f64>()
                })
            });
        }
        vec![Tensor::Image(image)]
    }
}
