//! `Guided`: the guided filter.
//!
//! K. He, J. Sun and X. Tang, Guided Image Filtering, ECCV 2010, equations 5, 6 and 8: in each window the output is the line
//! of the guide that fits the image best, a = cov(I, p)/(var(I) + ε), b = mean(p) − a·mean(I); a pixel takes the mean of the
//! lines of the windows it is in. All means are box means, so that the cost does not depend on the radius.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::box_blur::{box_mean, box_mean_reference};
use crate::shader;

/// Smooths an image and keeps the edges of a guide: around each pixel the output is a·Y + b, where Y is the luminance of the
/// guide and the line fits the image in the (2r + 1)² window best (He, Sun and Tang, Guided Image Filtering, 2010).
///
/// Every channel of the image has a line of its own. Guided by itself it denoises; guided by a photograph it carries edges
/// into a mask or a depth map. Guides whose values are far above 1 want a larger `eps`: their squares are kept in 32-bit floats.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Guided {
    /// The image to smooth.
    image: In<Image>,
    /// Where the edges are, of the same size; absent: the image itself.
    guide: Option<In<Image>>,
    /// Pixels to either side of a window.
    #[default = 8]
    #[schemars(range(min = 0, max = 8192), extend("x-unit" = "px"))]
    radius: u32,
    /// Variances of the guide well below it are smoothed, those well above it are edges.
    #[default = 1e-3]
    #[schemars(range(min = 1e-8, max = 1e6))]
    eps: f32,
}

pub(super) const KIND: Kind = Kind::of::<Guided>(
    "Guided",
    Category::Filters,
    &[
        r#"Guided(image: "in", guide: "grey")"#,
        r#"Guided(image: "grey", guide: "in", radius: 3, eps: 0.05)"#,
        r#"Guided(image: "in", eps: 0.1)"#,
        r#"Guided(image: "pair", guide: "other", radius: 1)"#,
    ],
)
.tolerance(2e-4, 1e-4);

impl Node for Guided {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        if let Some(guide) = &self.guide {
            inputs.same_size(&[("image", &self.image), ("guide", guide)])?;
        }
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let guide = self.guide.map_or(image, |guide| cx.input(&guide));
        let ImageType { size, channels, .. } = cx.image_of(image);
        let (values, pair) = (Shape::image(size, channels), Shape::image(size, 2));

        let products = cx.intermediate("products", values);
        cx.pass("products", shader!("filters/guided_products"))
            .entry(Entry::Point)
            .read("image", image, Reach::Point)
            .read("guide", guide, Reach::Point)
            .write("out", products)
            .add();
        let powers = cx.intermediate("powers", pair);
        cx.pass("powers", shader!("filters/guided_powers"))
            .entry(Entry::Point)
            .read("guide", guide, Reach::Point)
            .write("out", powers)
            .add();

        let mean = |cx: &mut Lowering<'_>, name: &str, of: ResourceId, shape: Shape| {
            let means = cx.intermediate(name, shape);
            box_mean(cx, &format!("{name}."), self.radius, of, means);
            means
        };
        let mean_image = mean(cx, "mean_image", image, values);
        let mean_products = mean(cx, "mean_products", products, values);
        let mean_powers = mean(cx, "mean_powers", powers, pair);

        let slope = cx.intermediate("slope", values);
        cx.pass("slope", shader!("filters/guided_slope"))
            .entry(Entry::Point)
            .read("image", mean_image, Reach::Point)
            .read("products", mean_products, Reach::Point)
            .read("powers", mean_powers, Reach::Point)
            .write("out", slope)
            .param("eps", self.eps)
            .add();
        let offset = cx.intermediate("offset", values);
        cx.pass("offset", shader!("filters/guided_offset"))
            .entry(Entry::Point)
            .read("image", mean_image, Reach::Point)
            .read("powers", mean_powers, Reach::Point)
            .read("slope", slope, Reach::Point)
            .write("out", offset)
            .add();

        let mean_slope = mean(cx, "mean_slope", slope, values);
        let mean_offset = mean(cx, "mean_offset", offset, values);
        cx.pass("", shader!("filters/guided"))
            .entry(Entry::Point)
            .read("guide", guide, Reach::Point)
            .read("slope", mean_slope, Reach::Point)
            .read("offset", mean_offset, Reach::Point)
            .write("out", out)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let guide = self.guide.map_or(image, |guide| cx.image(&guide)).map(1, |c| [luminance(c); 4]);
        let make =
            |f: &dyn Fn(i64, i64, usize) -> f64| Raster::from_fn(image.size, image.channels, |x, y| std::array::from_fn(|c| f(x, y, c)));
        let mean = |raster: &Raster| box_mean_reference(raster, self.radius, cx.border);
        let mean_guide = mean(&guide);
        let mean_square = mean(&guide.map(1, |[y, ..]| [y * y; 4]));
        let mean_image = mean(image);
        let mean_product = mean(&make(&|x, y, c| image.at(x, y)[c] * guide.at(x, y)[0]));
        let slope = make(&|x, y, c| {
            let m = mean_guide.at(x, y)[0];
            let covariance = mean_product.at(x, y)[c] - m * mean_image.at(x, y)[c];
            covariance / (mean_square.at(x, y)[0] - m * m + f64::from(self.eps))
        });
        let offset = make(&|x, y, c| mean_image.at(x, y)[c] - slope.at(x, y)[c] * mean_guide.at(x, y)[0]);
        let (slope, offset) = (mean(&slope), mean(&offset));
        vec![Tensor::Image(make(&|x, y, c| slope.at(x, y)[c] * guide.at(x, y)[0] + offset.at(x, y)[c]))]
    }
}
