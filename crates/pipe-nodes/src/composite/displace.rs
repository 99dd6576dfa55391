//! `Displace`: pushes pixels about by a map.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::pair::Pair;
use crate::shader;

/// Each pixel is fetched from `scale` times the map away: out(x, y) = image(x + scale·R, y + scale·G), R to the right
/// and G downwards in pixels. `options.filter` and `options.border` say how it is read there.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Displace {
    /// The image to distort.
    image: In<Image>,
    /// Red: how far to the right, green: how far down each pixel is fetched from. Of the image's size.
    map: In<Image>,
    /// Pixels that a map value of 1 stands for: a number, or `(x, y)`.
    #[default(Pair::Both(1.0))]
    #[schemars(range(min = -1e6, max = 1e6), extend("x-unit" = "px"))]
    scale: Pair,
}

pub(crate) const KIND: Kind = Kind::of::<Displace>(
    "Displace",
    Category::Composite,
    &[
        r#"Displace(image: "in", map: "pair", scale: 10)"#,
        r#"Displace(image: "in", map: "other", scale: (2.5, -40))"#,
        r#"Displace(image: "grey", map: "grey")"#,
    ],
)
.tolerance(1e-5, 1e-5);

impl Node for Displace {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        inputs.same_size(&[("image", &self.image), ("map", &self.map)])?;
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, map, out) = (cx.input(&self.image), cx.input(&self.map), cx.output("out"));
        let linear = cx.filter() == Filter::Linear;
        cx.pass("", shader!("composite/displace"))
            .read("image", image, Reach::Whole)
            .read("map", map, Reach::Point)
            .write("out", out)
            .constant("LINEAR", linear)
            .param("scale", self.scale.xy().map(|v| v as f32))
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (image, map) = (cx.image(&self.image), cx.image(&self.map));
        let [sx, sy] = self.scale.xy();
        let out = Raster::from_fn(image.size, image.channels, |x, y| {
            let [r, g, ..] = map.at(x, y);
            let (u, v) = (x as f64 + 0.5 + sx * r, y as f64 + 0.5 + sy * g);
            match cx.filter {
                Filter::Nearest => image.load(u.floor() as i64, v.floor() as i64, cx.border),
                Filter::Linear => image.sample(u, v, cx.border),
            }
        });
        vec![Tensor::Image(out)]
    }
}
