//! `Crop`: cuts a rectangle out.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// Cuts the rectangle of `width` × `height` pixels whose upper left pixel is (x, y). It must lie inside the image.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Crop {
    /// The image to cut from.
    image: In<Image>,
    /// First column, from the left.
    #[schemars(extend("x-unit" = "px"))]
    x: u32,
    /// First row, from the top.
    #[schemars(extend("x-unit" = "px"))]
    y: u32,
    /// Columns; absent: all to the right edge.
    #[schemars(range(min = 1), extend("x-unit" = "px"))]
    width: Option<u32>,
    /// Rows; absent: all to the bottom edge.
    #[schemars(range(min = 1), extend("x-unit" = "px"))]
    height: Option<u32>,
}

pub(crate) const KIND: Kind = Kind::of::<Crop>(
    "Crop",
    Category::Composite,
    &[
        r#"Crop(image: "in", width: "=ceil(in.width/2)", height: "=ceil(in.height/2)")"#,
        r#"Crop(image: "in", x: "=floor(in.width/3)", y: "=floor(in.height/3)")"#,
        r#"Crop(image: "grey", x: "=grey.width-1", width: 1)"#,
    ],
)
.tolerance(0.0, 0.0);

/// The extent that `wanted` gives from `first` on in `all`, or what is wrong with it.
fn extent(field: &'static str, first: u32, wanted: Option<u32>, all: u32) -> Result<u32, Mistake> {
    if first >= all {
        let start = if field == "width" { "x" } else { "y" };
        return Err(Mistake::in_field(start, format!("{start} = {first} is outside the image, whose {field} is {all}"))
            .hint(format!("expected 0 to {}", all - 1)));
    }
    let rest = all - first;
    match wanted {
        None => Ok(rest),
        Some(n) if n <= rest => Ok(n),
        Some(n) => Err(Mistake::in_field(field, format!("{field} = {n} leaves the image, whose {field} is {all}"))
            .hint(format!("from {first} on, {rest} are left; `Pad` adds pixels outside"))),
    }
}

impl Crop {
    fn size(&self, image: [u32; 2]) -> Result<[u32; 2], Mistake> {
        Ok([extent("width", self.x, self.width, image[0])?, extent("height", self.y, self.height, image[1])?])
    }
}

impl Node for Crop {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let image = inputs.image(&self.image);
        Ok(Output::out(EdgeType::Image(image.with_size(self.size(image.size)?))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        if (self.x, self.y) == (0, 0) && cx.pass_on("out", image) {
            return Ok(());
        }
        let out = cx.output("out");
        cx.pass("", shader!("composite/crop"))
            .read_with("image", image, Reach::shifted([self.x as i32, self.y as i32]), Border::Clamp, Filter::Nearest)
            .write("out", out)
            .values(Values::Read)
            .param("origin", [self.x as i32, self.y as i32])
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let size = self.size(image.size).unwrap_or(image.size);
        let (x0, y0) = (i64::from(self.x), i64::from(self.y));
        vec![Tensor::Image(Raster::from_fn(size, image.channels, |x, y| image.at(x0 + x, y0 + y)))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_that_leaves_the_image_is_a_mistake() {
        let crop = |x, width| Crop { x, width, ..Crop::default() }.size([10, 10]);
        assert_eq!(crop(0, None), Ok([10, 10]));
        assert_eq!(crop(7, Some(3)), Ok([3, 10]));
        assert_eq!(crop(7, Some(4)).unwrap_err().field.as_deref(), Some("width"));
        assert_eq!(crop(10, None).unwrap_err().field.as_deref(), Some("x"));
        assert_eq!(crop(u32::MAX, Some(u32::MAX)).unwrap_err().field.as_deref(), Some("x"));
    }
}
