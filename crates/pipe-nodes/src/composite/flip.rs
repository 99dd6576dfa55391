//! `Flip`: turns an image upside down, or left to right.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// Mirrors an image.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Flip {
    /// The image to mirror.
    image: In<Image>,
    /// Which way.
    direction: Direction,
}

/// Which way to mirror.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Direction {
    /// Top becomes bottom.
    #[default]
    Vertical,
    /// Left becomes right.
    Horizontal,
    /// Both: a half turn.
    Both,
}

pub(crate) const KIND: Kind = Kind::of::<Flip>(
    "Flip",
    Category::Composite,
    &[
        r#"Flip(image: "in")"#,
        r#"Flip(image: "in", direction: Vertical)"#,
        r#"Flip(image: "grey", direction: Horizontal)"#,
        r#"Flip(image: "in", direction: Both)"#,
    ],
)
.tolerance(0.0, 0.0);

impl Node for Flip {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let size = cx.image_of(image).size;
        let flipped = [self.direction != Direction::Vertical, self.direction != Direction::Horizontal];
        let looks = [0, 1].map(|i| if flipped[i] { Stretch::mirrored(i, size[i]) } else { Stretch::shift(i, 0) });
        cx.pass("", shader!("composite/flip"))
            .read_with("image", image, Reach::Elsewhere(looks), Border::Clamp, Filter::Nearest)
            .write("out", out)
            .values(Values::Read)
            .constant("X", flipped[0])
            .constant("Y", flipped[1])
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let [w, h] = image.size.map(i64::from);
        let out = Raster::from_fn(image.size, image.channels, |x, y| match self.direction {
            Direction::Vertical => image.at(x, h - 1 - y),
            Direction::Horizontal => image.at(w - 1 - x, y),
            Direction::Both => image.at(w - 1 - x, h - 1 - y),
        });
        vec![Tensor::Image(out)]
    }
}
