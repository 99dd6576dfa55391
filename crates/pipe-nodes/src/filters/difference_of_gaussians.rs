//! `DifferenceOfGaussians`: a band of sizes.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::gaussian::{blur, separable_reference};
use crate::shader;

/// A blur less a wider one: G(σ1)∗in − G(σ2)∗in. It keeps details between the two sizes, positive on what is brighter than
/// its surroundings. With σ2 = 1.6·σ1, the default, it is close to the Laplacian of a Gaussian (Marr and Hildreth, Theory of
/// Edge Detection, 1980). Per channel; alpha 1.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct DifferenceOfGaussians {
    /// The image.
    image: In<Image>,
    /// Standard deviation of the blur that is kept; 0 takes the image itself.
    #[default = 1.0]
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "px"))]
    sigma1: f32,
    /// Standard deviation of the blur that is taken away.
    #[default = 1.6]
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "px"))]
    sigma2: f32,
}

pub(super) const KIND: Kind = Kind::of::<DifferenceOfGaussians>(
    "DifferenceOfGaussians",
    Category::Filters,
    &[
        r#"DifferenceOfGaussians(image: "in")"#,
        r#"DifferenceOfGaussians(image: "grey", sigma1: 0, sigma2: 3)"#,
        r#"DifferenceOfGaussians(image: "pair", sigma1: 2, sigma2: 1)"#,
    ],
)
.tolerance(5e-6, 1e-5);

impl Node for DifferenceOfGaussians {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let ty = cx.image_of(out);
        // A difference of nearly equal values needs all their digits.
        let shape = Shape::image(ty.size, ty.channels);
        let (fine, coarse) = (cx.intermediate("fine", shape), cx.intermediate("coarse", shape));
        blur(cx, "fine.", [self.sigma1; 2], image, fine);
        blur(cx, "coarse.", [self.sigma2; 2], image, coarse);
        cx.pass("", shader!("filters/difference_of_gaussians"))
            .entry(Entry::Point)
            .read("fine", fine, Reach::Point)
            .read("coarse", coarse, Reach::Point)
            .write("out", out)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let blurred = |sigma: f32| separable_reference(image, [sigma; 2], cx.border);
        let (fine, coarse) = (blurred(self.sigma1), blurred(self.sigma2));
        vec![Tensor::Image(Raster::from_fn(image.size, image.channels, |x, y| {
            let (a, b) = (fine.at(x, y), coarse.at(x, y));
            [a[0] - b[0], a[1] - b[1], a[2] - b[2], 1.0]
        }))]
    }
}
