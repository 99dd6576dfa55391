//! `Median`: the middle value of a square.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::selection_network::Network;
use crate::shader;

/// The middle of the (2r + 1)² values around each pixel, in every channel by itself: takes away single wrong pixels and
/// keeps edges. A NaN counts as larger than every number, so that a few of them disappear.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Median {
    /// The image.
    image: In<Image>,
    /// Pixels to either side.
    #[default = 1]
    #[schemars(range(min = 1, max = 3), extend("x-unit" = "px"))]
    radius: u32,
}

pub(super) const KIND: Kind = Kind::of::<Median>(
    "Median",
    Category::Filters,
    &[r#"Median(image: "in")"#, r#"Median(image: "grey", radius: 2)"#, r#"Median(image: "pair", radius: 3)"#],
)
.tolerance(0.0, 0.0);

impl Median {
    /// The shader of this radius: its comparisons stand one after another.
    fn shader(&self) -> Shader {
        let (r, side) = (self.radius as i32, 2 * self.radius as i32 + 1);
        let network = Network::median((side * side) as usize);
        let load = |i: usize| format!("order(load_image(xy + vec2i({}, {})))", i as i32 % side - r, i as i32 / side - r);
        let shader = shader!("filters/median");
        let text = format!(
            "{}\nfn at(xy: vec2i) -> vec4f {{\n{}    return value(v{});\n}}\n",
            shader.source,
            network.wgsl(load),
            network.result()
        );
        Shader::builtin(&shader.path, &text)
    }
}

impl Node for Median {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        cx.pass("", self.shader())
            .read("image", image, Reach::Around(self.radius, self.radius))
            .write("out", out)
            .values(Values::Read)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let r = i64::from(self.radius);
        vec![Tensor::Image(Raster::from_fn(image.size, image.channels, |x, y| {
            let window: Vec<[f64; 4]> =
                (-r..=r).flat_map(|dy| (-r..=r).map(move |dx| (dx, dy))).map(|(dx, dy)| image.load(x + dx, y + dy, cx.border)).collect();
            std::array::from_fn(|c| {
                let mut values: Vec<f64> = window.iter().map(|p| if p[c].is_nan() { f64::NAN } else { p[c] }).collect();
                values.sort_unstable_by(f64::total_cmp);
                values[values.len() / 2]
            })
        }))]
    }
}
