//! `Pad`: adds a frame of pixels.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// Adds rows and columns around an image.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Pad {
    /// The image to enlarge.
    image: In<Image>,
    /// Columns added at the left.
    #[schemars(range(max = 65536), extend("x-unit" = "px"))]
    left: u32,
    /// Columns added at the right.
    #[schemars(range(max = 65536), extend("x-unit" = "px"))]
    right: u32,
    /// Rows added above.
    #[schemars(range(max = 65536), extend("x-unit" = "px"))]
    top: u32,
    /// Rows added below.
    #[schemars(range(max = 65536), extend("x-unit" = "px"))]
    bottom: u32,
    /// What the new pixels hold.
    fill: Fill,
}

/// What the new pixels hold.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Fill {
    /// Transparent black.
    #[default]
    Black,
    /// This colour: red, green, blue, alpha (a 1-channel image takes the red).
    Color([f32; 4]),
    /// The nearest pixel of the image.
    Clamp,
    /// The image reflected at its edges.
    Mirror,
    /// The image repeated.
    Repeat,
}

pub(crate) const KIND: Kind = Kind::of::<Pad>(
    "Pad",
    Category::Composite,
    &[
        r#"Pad(image: "in", left: 4, right: 4, top: 4, bottom: 4)"#,
        r#"Pad(image: "in", left: 3, fill: Color([0.25, 0.5, 2.0, 1.0]))"#,
        r#"Pad(image: "in", right: 70, bottom: 9, fill: Clamp)"#,
        r#"Pad(image: "in", left: 70, top: 9, fill: Mirror)"#,
        r#"Pad(image: "in", left: 5, bottom: 130, fill: Repeat)"#,
        r#"Pad(image: "grey", top: 2, fill: Color([0.5, 0, 0, 1]))"#,
        r#"Pad(image: "grey", top: 2)"#,
    ],
)
.tolerance(0.0, 0.0);

impl Fill {
    const fn border(self) -> Border {
        match self {
            Self::Clamp => Border::Clamp,
            Self::Mirror => Border::Mirror,
            Self::Repeat => Border::Repeat,
            Self::Black | Self::Color(_) => Border::Black,
        }
    }

    const fn color(self) -> Option<[f32; 4]> {
        match self {
            Self::Black => Some([0.0; 4]),
            Self::Color(color) => Some(color),
            _ => None,
        }
    }
}

impl Node for Pad {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let image = inputs.image(&self.image);
        let [w, h] = image.size;
        // The resolver has bounded every term.
        let size = [w.saturating_add(self.left + self.right), h.saturating_add(self.top + self.bottom)];
        Ok(Output::out(EdgeType::Image(image.with_size(size))))
    }

    fn makes_alpha(&self) -> bool {
        self.fill.color().is_some_and(|color| color[3] != 1.0)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        // Of the same size: nothing was added.
        if cx.pass_on("out", image) {
            return Ok(());
        }
        let out = cx.output("out");
        let reach = Reach::shifted([self.left, self.top].map(|n| -(n as i32)));
        cx.pass("", shader!("composite/pad"))
            .read_with("image", image, reach, self.fill.border(), Filter::Nearest)
            .write("out", out)
            .constant("COLORED", self.fill.color().is_some())
            .param("origin", [self.left as i32, self.top as i32])
            .param("color", self.fill.color().unwrap_or_default())
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let [w, h] = image.size;
        let size = [w + self.left + self.right, h + self.top + self.bottom];
        let out = Raster::from_fn(size, image.channels, |x, y| {
            let (x, y) = (x - i64::from(self.left), y - i64::from(self.top));
            let inside = (0..i64::from(w)).contains(&x) && (0..i64::from(h)).contains(&y);
            match self.fill.color() {
                Some(color) if !inside => color.map(f64::from),
                _ => image.load(x, y, self.fill.border()),
            }
        });
        vec![Tensor::Image(out)]
    }
}
