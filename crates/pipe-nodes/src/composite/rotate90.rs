//! `Rotate90`: quarter turns, without resampling.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// Turns an image by quarters of a circle. Every pixel is kept; an odd number of turns swaps width and height.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Rotate90 {
    /// The image to turn.
    image: In<Image>,
    /// Quarter turns clockwise; negative: counter-clockwise.
    #[default = 1]
    #[schemars(range(min = -3, max = 3))]
    turns: i32,
}

pub(crate) const KIND: Kind = Kind::of::<Rotate90>(
    "Rotate90",
    Category::Composite,
    &[
        r#"Rotate90(image: "in")"#,
        r#"Rotate90(image: "in", turns: 2)"#,
        r#"Rotate90(image: "grey", turns: -1)"#,
        r#"Rotate90(image: "in", turns: 0)"#,
    ],
)
.tolerance(0.0, 0.0);

impl Rotate90 {
    fn size(&self, [w, h]: [u32; 2]) -> [u32; 2] {
        if self.turns % 2 == 0 { [w, h] } else { [h, w] }
    }
}

impl Node for Rotate90 {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let image = inputs.image(&self.image);
        Ok(Output::out(EdgeType::Image(image.with_size(self.size(image.size)))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        let turns = self.turns.rem_euclid(4);
        if turns == 0 {
            cx.emit("out", image);
            return Ok(());
        }
        let out = cx.output("out");
        let [w, h] = cx.image_of(image).size;
        let looks = match turns {
            1 => [Stretch::shift(1, 0), Stretch::mirrored(0, h)],
            2 => [Stretch::mirrored(0, w), Stretch::mirrored(1, h)],
            _ => [Stretch::mirrored(1, w), Stretch::shift(0, 0)],
        };
        cx.pass("", shader!("composite/rotate90"))
            .read_with("image", image, Reach::Elsewhere(looks), Border::Clamp, Filter::Nearest)
            .write("out", out)
            .values(Values::Read)
            .constant("TURNS", turns)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let mut image = cx.image(&self.image).clone();
        for _ in 0..self.turns.rem_euclid(4) {
            let [w, h] = image.size;
            // Clockwise: the left column, read upwards, becomes the top row.
            image = Raster::from_fn([h, w], image.channels, |x, y| image.at(y, i64::from(h) - 1 - x));
        }
        vec![Tensor::Image(image)]
    }
}
