//! `Laplacian`: second derivatives.

use pipe_graph::prelude::*;

use crate::shader;

/// The 5-point Laplacian ∂²/∂x² + ∂²/∂y²: the sum of the four neighbours less four times the pixel, so that it is
/// negative on a bright dot. Per channel; alpha 1.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Laplacian {
    /// The image.
    image: In<Image>,
}

pub(super) const KIND: Kind = Kind::of::<Laplacian>(
    "Laplacian",
    Category::Filters,
    &[r#"Laplacian(image: "in")"#, r#"Laplacian(image: "grey")"#, r#"Laplacian(image: "pair")"#],
)
.tolerance(5e-6, 1e-5);

impl Node for Laplacian {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        cx.pass("", shader!("filters/laplacian")).read("image", image, Reach::Around(1, 1)).write("out", out).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        vec![Tensor::Image(Raster::from_fn(image.size, image.channels, |x, y| {
            let load = |dx, dy| image.load(x + dx, y + dy, cx.border);
            let (here, left, right, above, below) = (load(0, 0), load(-1, 0), load(1, 0), load(0, -1), load(0, 1));
            std::array::from_fn(|c| if c < 3 { left[c] + right[c] + above[c] + below[c] - 4.0 * here[c] } else { 1.0 })
        }))]
    }
}
