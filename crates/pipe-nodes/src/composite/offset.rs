//! `Offset`: shifts an image by whole pixels.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// Shifts an image by whole pixels within its frame. What leaves at one side comes back at the other, unless `wrap`
/// is off: then `options.border` says what comes in. (`Transform` shifts by fractions of a pixel.)
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Offset {
    /// The image to shift.
    image: In<Image>,
    /// To the right.
    #[schemars(range(min = -65536, max = 65536), extend("x-unit" = "px"))]
    x: i32,
    /// Downwards.
    #[schemars(range(min = -65536, max = 65536), extend("x-unit" = "px"))]
    y: i32,
    /// Whether the image is taken as periodic.
    #[default = true]
    wrap: bool,
}

pub(crate) const KIND: Kind = Kind::of::<Offset>(
    "Offset",
    Category::Composite,
    &[
        r#"Offset(image: "in", x: 10, y: -4)"#,
        r#"Offset(image: "in", x: 5, wrap: false)"#,
        r#"Offset(image: "grey", x: -300, y: 3)"#,
        r#"Offset(image: "grey", x: -30, y: 3, wrap: false)"#,
    ],
)
.tolerance(0.0, 0.0);

impl Node for Offset {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        if (self.x, self.y) == (0, 0) && cx.pass_on("out", image) {
            return Ok(());
        }
        let out = cx.output("out");
        let border = if self.wrap { Border::Repeat } else { cx.border() };
        cx.pass("", shader!("composite/offset"))
            .read_with("image", image, Reach::shifted([-self.x, -self.y]), border, Filter::Nearest)
            .write("out", out)
            .values(Values::Read)
            .param("offset", [self.x, self.y])
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let border = if self.wrap { Border::Repeat } else { cx.border };
        let (dx, dy) = (i64::from(self.x), i64::from(self.y));
        vec![Tensor::Image(Raster::from_fn(image.size, image.channels, |x, y| image.load(x - dx, y - dy, border)))]
    }
}
