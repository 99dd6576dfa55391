//! `ColorMatrix`: a linear map of colour.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{point, same};
use crate::shader;

/// Multiplies colour by a matrix: 3×3 (rgb) or 4×4 (rgba). Rows of the matrix are rows of the list.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct ColorMatrix {
    /// The image.
    image: In<Image>,
    /// Three rows of three numbers, or four of four.
    #[default(vec![vec![1.0, 0.0, 0.0], vec![0.0, 1.0, 0.0], vec![0.0, 0.0, 1.0]])]
    matrix: Vec<Vec<f32>>,
}

pub(super) const KIND: Kind = Kind::of::<ColorMatrix>(
    "ColorMatrix",
    Category::Colour,
    &[
        r#"ColorMatrix(image: "in", matrix: [[0.393, 0.769, 0.189], [0.349, 0.686, 0.168], [0.272, 0.534, 0.131]])"#,
        r#"ColorMatrix(image: "in", matrix: [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 0.5, 0], [0.2, 0, 0, 0.8]])"#,
    ],
)
.sets_alpha();

impl ColorMatrix {
    /// As 4×4.
    fn rows(&self) -> [[f32; 4]; 4] {
        let mut rows = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        for (row, from) in rows.iter_mut().zip(&self.matrix) {
            row[..from.len()].copy_from_slice(from);
        }
        rows
    }
}

impl Node for ColorMatrix {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        let n = self.matrix.len();
        if !matches!(n, 3 | 4) || self.matrix.iter().any(|row| row.len() != n) {
            return Err(Mistake::in_field("matrix", "has the wrong size").hint("expected 3 rows of 3 numbers, or 4 rows of 4"));
        }
        Ok(())
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let [r, g, b, a] = self.rows();
        point(cx, &self.image, shader!("colour/color_matrix")).param("r", r).param("g", g).param("b", b).param("a", a).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let rows = self.rows();
        vec![Tensor::Image(image.map(image.channels, |p| rows.map(|row| row.iter().zip(p).map(|(m, v)| f64::from(*m) * v).sum())))]
    }
}
