//! `Jacobi`: relaxation towards the solution of a Poisson equation.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::state::widened;
use crate::shader;

/// Relaxes towards ∇²u = rhs with the 5-point ∇² on pixels of side 1: in each iteration
/// u⁺(x, y) = (u(x−1, y) + u(x+1, y) + u(x, y−1) + u(x, y+1) − rhs(x, y))/4, in each colour channel; alpha is kept.
/// `options.border` is the rim: `Black` holds 0, `Clamp` lets nothing through, `Repeat` is periodic. Smooth errors fade
/// slowly: n pixels across take some n² iterations.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Jacobi {
    /// The first guess.
    image: In<Image>,
    /// The right side, of the same size; absent: 0 (Laplace's equation).
    rhs: Option<In<Image>>,
    /// How often.
    #[default = 100]
    #[schemars(range(min = 0, max = 100_000_000))]
    iterations: u32,
}

pub(crate) const KIND: Kind = Kind::of::<Jacobi>(
    "Jacobi",
    Category::Simulation,
    &[
        r#"Jacobi(image: "in", iterations: 10)"#,
        r#"Jacobi(image: "in", rhs: "other", iterations: 10)"#,
        r#"Jacobi(image: "grey", rhs: "grey", iterations: 60)"#,
        r#"Jacobi(image: "pair", rhs: "grey", iterations: 1)"#,
        r#"Jacobi(image: "in", iterations: 0)"#,
    ],
)
.tolerance(2e-5, 1e-5);

impl Node for Jacobi {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        if let Some(rhs) = &self.rhs {
            inputs.same_size(&[("image", &self.image), ("rhs", rhs)])?;
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
        let rhs = self.rhs.map(|rhs| cx.input(&rhs));
        let shape = cx.shape(image);
        let end = cx.repeat("", Count::Fixed(self.iterations), &[image], |cx, states| {
            let next = cx.intermediate("next", shape);
            let shader = if rhs.is_some() { shader!("simulation/jacobi") } else { shader!("simulation/jacobi_laplace") };
            let mut pass = cx.pass("relax", shader).read("image", states[0], Reach::Around(1, 1));
            if let Some(rhs) = rhs {
                pass = pass.read("rhs", rhs, Reach::Point);
            }
            pass.write("out", next).add();
            Ok(vec![next])
        })?;
        cx.emit("out", end[0]);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let mut u = cx.image(&self.image).clone();
        let rhs = self.rhs.map(|rhs| cx.image(&rhs));
        for _ in 0..self.iterations {
            let load = |x, y| u.load(x, y, cx.border);
            u = Raster::from_fn(u.size, u.channels, |x, y| {
                let neighbours = [load(x - 1, y), load(x + 1, y), load(x, y - 1), load(x, y + 1)];
                let f = rhs.map_or([0.0; 4], |rhs| rhs.at(x, y));
                let relaxed = |c: usize| (neighbours.iter().map(|n| n[c]).sum::<f64>() - f[c]) / 4.0;
                [relaxed(0), relaxed(1), relaxed(2), load(x, y)[3]]
            });
        }
        vec![Tensor::Image(u)]
    }
}
