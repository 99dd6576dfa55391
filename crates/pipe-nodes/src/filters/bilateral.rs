//! `Bilateral`: a blur that stops at edges.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::gaussian::radius;
use crate::shader;

/// Blurs among similar colours: the mean of the pixels around, weighted by
/// exp(−(dx² + dy²)/2σs²)·exp(−|c − c′|²/2σr²) (Tomasi and Manduchi, Bilateral Filtering for Gray and Color Images, 1998).
///
/// |c − c′| is the Euclidean distance of the colours; alpha is averaged with them and has no part in it. The window is the
/// square of radius ceil(3σs), so the cost grows with σs².
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Bilateral {
    /// The image.
    image: In<Image>,
    /// Standard deviation σs in the plane.
    #[default = 3.0]
    #[schemars(range(min = 0.1, max = 12.0), extend("x-unit" = "px"))]
    sigma_space: f32,
    /// Standard deviation σr among colours: differences well above it are edges.
    #[default = 0.1]
    #[schemars(range(min = 1e-4, max = 1e6))]
    sigma_range: f32,
}

pub(super) const KIND: Kind = Kind::of::<Bilateral>(
    "Bilateral",
    Category::Filters,
    &[
        r#"Bilateral(image: "in")"#,
        r#"Bilateral(image: "grey", sigma_space: 1.5, sigma_range: 0.5)"#,
        r#"Bilateral(image: "pair", sigma_space: 1, sigma_range: 2)"#,
    ],
)
.tolerance(1e-5, 1e-5);

/// −1/2σ²
fn exponent(sigma: f32) -> f64 {
    -0.5 / (f64::from(sigma) * f64::from(sigma))
}

impl Node for Bilateral {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let r = radius(self.sigma_space);
        let grey = cx.image_of(image).channels == 1;
        cx.pass("", shader!("filters/bilateral"))
            .read("image", image, Reach::Around(r, r))
            .write("out", out)
            .constant("RADIUS", r as i32)
            .constant("GREY", grey)
            .param("space", exponent(self.sigma_space) as f32)
            .param("range", exponent(self.sigma_range) as f32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let r = i64::from(radius(self.sigma_space));
        let (space, range) = (exponent(self.sigma_space), exponent(self.sigma_range));
        let compared = if image.channels == 1 { 1 } else { 3 };
        vec![Tensor::Image(Raster::from_fn(image.size, image.channels, |x, y| {
            let here = image.at(x, y);
            let (mut sum, mut total) = ([0.0; 4], 0.0);
            for dy in -r..=r {
                for dx in -r..=r {
                    let p = image.load(x + dx, y + dy, cx.border);
                    let distance: f64 = (0..compared).map(|c| (p[c] - here[c]).powi(2)).sum();
                    let weight = (space * (dx * dx + dy * dy) as f64).exp() * (range * distance).exp();
                    for c in 0..4 {
                        sum[c] += weight * p[c];
                    }
                    total += weight;
                }
            }
            sum.map(|s| s / total)
        }))]
    }
}
