//! `Tile`: repeats an image in columns and rows.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// Lays copies of an image side by side; the result is as many times larger.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Tile {
    /// The image to repeat.
    image: In<Image>,
    /// Copies from left to right.
    #[default = 2]
    #[schemars(range(min = 1, max = 1024))]
    columns: u32,
    /// Copies from top to bottom.
    #[default = 2]
    #[schemars(range(min = 1, max = 1024))]
    rows: u32,
    /// Whether every other copy is mirrored, so that edges meet.
    mirror: bool,
}

pub(crate) const KIND: Kind = Kind::of::<Tile>(
    "Tile",
    Category::Composite,
    &[r#"Tile(image: "in")"#, r#"Tile(image: "in", columns: 3, rows: 2, mirror: true)"#, r#"Tile(image: "grey", columns: 1, rows: 3)"#],
)
.tolerance(0.0, 0.0);

impl Tile {
    const fn size(&self, [w, h]: [u32; 2]) -> [u32; 2] {
        [w.saturating_mul(self.columns), h.saturating_mul(self.rows)]
    }

    const fn border(&self) -> Border {
        if self.mirror { Border::Mirror } else { Border::Repeat }
    }
}

impl Node for Tile {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let image = inputs.image(&self.image);
        Ok(Output::out(EdgeType::Image(image.with_size(self.size(image.size)))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        cx.pass("", shader!("composite/tile"))
            .read_with("image", image, Reach::Whole, self.border(), Filter::Nearest)
            .write("out", out)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let [w, h] = image.size.map(i64::from);
        let out = Raster::from_fn(self.size(image.size), image.channels, |x, y| {
            let (column, row) = (x / w, y / h);
            let (x, y) = (x % w, y % h);
            let x = if self.mirror && column % 2 == 1 { w - 1 - x } else { x };
            let y = if self.mirror && row % 2 == 1 { h - 1 - y } else { y };
            image.at(x, y)
        });
        vec![Tensor::Image(out)]
    }
}
