//! `UnsharpMask`: sharpens by what a blur takes away.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::gaussian::{blur, separable_reference};
use crate::shader;

/// Sharpens: in + amount·(in − blur), where |in − blur| > threshold. Per channel, alpha kept.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct UnsharpMask {
    /// The image.
    image: In<Image>,
    /// Standard deviation of the blur.
    #[default = 2.0]
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "px"))]
    sigma: f32,
    /// How much.
    #[default = 1.0]
    amount: f32,
    /// Differences up to it stay as they are.
    #[schemars(range(min = 0.0))]
    threshold: f32,
}

pub(super) const KIND: Kind = Kind::of::<UnsharpMask>(
    "UnsharpMask",
    Category::Filters,
    &[
        r#"UnsharpMask(image: "in")"#,
        r#"UnsharpMask(image: "in", sigma: 1, amount: 0.5)"#,
        r#"UnsharpMask(image: "grey", sigma: 3, amount: 2)"#,
    ],
)
.tolerance(1e-5, 1e-5);

impl Node for UnsharpMask {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let shape = cx.shape(out);
        let blurred = cx.intermediate("blurred", shape);
        blur(cx, "blur.", [self.sigma; 2], image, blurred);
        cx.pass("", shader!("filters/unsharp_mask"))
            .entry(Entry::Point)
            .read("image", image, Reach::Point)
            .read("blurred", blurred, Reach::Point)
            .write("out", out)
            .param("amount", self.amount)
            .param("threshold", self.threshold)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let blurred = separable_reference(image, [self.sigma; 2], cx.border);
        vec![Tensor::Image(Raster::from_fn(image.size, image.channels, |x, y| {
            let (a, b) = (image.at(x, y), blurred.at(x, y));
            std::array::from_fn(|c| {
                let d = a[c] - b[c];
                if c < 3 && d.abs() > f64::from(self.threshold) { a[c] + f64::from(self.amount) * d } else { a[c] }
            })
        }))]
    }
}
