//! `StMap`: rearranges an image by a map of coordinates.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::pair::Pair;
use crate::shader;

/// Each pixel of the map says where in the image to look: red from 0 at the left edge to 1 at the right, green from 0
/// at the top edge to 1 at the bottom, both times `scale`. The result has the map's size. `options.filter` and
/// `options.border` say how the image is read there. (Maps whose green grows upwards want `scale: (1, -1)` and
/// `options: (border: Repeat)`.)
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct StMap {
    /// The image to look things up in.
    image: In<Image>,
    /// Red: s, green: t.
    map: In<Image>,
    /// Factor on the coordinates: a number, or `(s, t)`.
    #[default(Pair::Both(1.0))]
    #[schemars(range(min = -1e6, max = 1e6))]
    scale: Pair,
}

pub(crate) const KIND: Kind = Kind::of::<StMap>(
    "StMap",
    Category::Composite,
    &[
        r#"StMap(image: "in", map: "pair")"#,
        r#"StMap(image: "in", map: "other", scale: (2, -1))"#,
        r#"StMap(image: "grey", map: "pair", scale: 0.25)"#,
    ],
)
.tolerance(1e-5, 1e-5);

impl Node for StMap {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let (image, map) = (inputs.image(&self.image), inputs.image(&self.map));
        Ok(Output::out(EdgeType::Image(image.with_size(map.size))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, map, out) = (cx.input(&self.image), cx.input(&self.map), cx.output("out"));
        let linear = cx.filter() == Filter::Linear;
        cx.pass("", shader!("composite/st_map"))
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
        let [w, h] = image.size.map(f64::from);
        let out = Raster::from_fn(map.size, image.channels, |x, y| {
            let [s, t, ..] = map.at(x, y);
            let (u, v) = (s * sx * w, t * sy * h);
            match cx.filter {
                Filter::Nearest => image.load(u.floor() as i64, v.floor() as i64, cx.border),
                Filter::Linear => image.sample(u, v, cx.border),
            }
        });
        vec![Tensor::Image(out)]
    }
}
