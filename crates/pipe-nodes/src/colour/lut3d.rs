//! `Lut3d`: a colour cube from a file.

use pipe_graph::prelude::*;

use crate::colour::cube::Cube;
use crate::colour::point::{map_tinted, point, tinted};
use crate::shader;

/// Looks colour up in a cube (Adobe .cube, `LUT_3D_SIZE`), interpolated in tetrahedra (Kasson, Nin, Plouffe, Hafner 1995).
///
/// Colour outside the cube's domain is clamped to it first, so a cube for log-encoded pictures wants a `Colorspace` or
/// `Curves` before it. Where one channel is NaN, all become NaN. Alpha is kept, 1-channel images become colour.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Lut3d {
    /// The image.
    image: In<Image>,
    /// The .cube file, relative to the graph file.
    path: String,
    #[serde(skip)]
    cube: Cube,
}

pub(super) const KIND: Kind = Kind::of::<Lut3d>(
    "Lut3d",
    Category::Colour,
    &[
        r#"Lut3d(image: "in", path: "data/film.cube")"#,
        r#"Lut3d(image: "grey", path: "data/film.cube")"#,
        r#"Lut3d(image: "in", path: "data/negative.cube")"#,
    ],
)
.tolerance(5e-6, 1e-5);

/// Longest file: a cube of 256³ colours with thrice ten digits each.
const MOST_BYTES: usize = 1 << 29;

impl Node for Lut3d {
    fn open(&mut self, cx: &Opening<'_>) -> Result<(), Mistake> {
        let wrong = |message: String| Mistake::in_field("path", message);
        if self.path.is_empty() {
            return Err(wrong("is missing".to_owned()).hint("expected `path: \"look.cube\"`"));
        }
        let text = cx.loader.text(&cx.folder.join(&self.path), MOST_BYTES).map_err(|reason| wrong(format!("cannot be read: {reason}")))?;
        self.cube = Cube::parse(&text).map_err(|reason| wrong(format!("is no .cube file that can be used: {reason}")))?;
        Ok(())
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        tinted(inputs, &self.image, true)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let Cube { size, low, high, values } = &self.cube;
        let steps = (size - 1) as f32;
        let scale: [f32; 3] = std::array::from_fn(|i| steps / (high[i] - low[i]));
        let table = cx.floats("cube", values.as_flattened());
        point(cx, &self.image, shader!("colour/lut3d"))
            .read("cube", table, Reach::Whole)
            .constant("SIZE", *size as i32)
            .param("low", *low)
            .param("scale", scale)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        map_tinted(cx, &self.image, true, |c| self.cube.tetrahedral(c))
    }
}
