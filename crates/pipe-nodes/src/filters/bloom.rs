//! `Bloom`: light that spills over.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::gaussian::{blur, separable_reference};
use crate::shader;

/// Adds a blur of what is brighter than a threshold: in + intensity·blur(max(in − threshold, 0)). Alpha is kept.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Bloom {
    /// The image.
    image: In<Image>,
    /// What is above it spills over.
    #[default = 1.0]
    threshold: f32,
    /// Standard deviation of the blur.
    #[default = 12.0]
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "px"))]
    sigma: f32,
    /// How much is added.
    #[default = 0.2]
    intensity: f32,
}

pub(super) const KIND: Kind = Kind::of::<Bloom>(
    "Bloom",
    Category::Filters,
    &[r#"Bloom(image: "in", sigma: 4)"#, r#"Bloom(image: "grey", threshold: 0.3, sigma: 2, intensity: 0.7)"#],
)
.tolerance(1e-5, 1e-5);

impl Node for Bloom {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let shape = cx.shape(out);
        let (bright, blurred) = (cx.intermediate("bright", shape), cx.intermediate("blurred", shape));
        cx.pass("bright", shader!("filters/bloom_bright"))
            .entry(Entry::Point)
            .read("image", image, Reach::Point)
            .write("out", bright)
            .param("threshold", self.threshold)
            .add();
        blur(cx, "blur.", [self.sigma; 2], bright, blurred);
        cx.pass("", shader!("filters/bloom"))
            .entry(Entry::Point)
            .read("image", image, Reach::Point)
            .read("blurred", blurred, Reach::Point)
            .write("out", out)
            .param("intensity", self.intensity)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let bright = image.map(image.channels, |[r, g, b, a]| {
            let over = |v: f64| (v - f64::from(self.threshold)).max(0.0);
            [over(r), over(g), over(b), a]
        });
        let blurred = separable_reference(&bright, [self.sigma; 2], cx.border);
        vec![Tensor::Image(Raster::from_fn(image.size, image.channels, |x, y| {
            let (a, b) = (image.at(x, y), blurred.at(x, y));
            std::array::from_fn(|c| if c < 3 { a[c] + f64::from(self.intensity) * b[c] } else { a[c] })
        }))]
    }
}
