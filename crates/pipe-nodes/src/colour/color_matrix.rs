//! `ColorMatrix`: a linear map of colour.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{point, tinted, tinted_channels};
use crate::shader;

/// Multiplies colour by a matrix: 3×3 (red, green, blue; alpha is kept) or 4×4 (red, green, blue, alpha). Rows of the
/// matrix are rows of the list: the first row makes red.
///
/// A 1-channel image becomes colour unless the matrix keeps grey grey.
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
        r#"ColorMatrix(image: "grey", matrix: [[0.393, 0.769, 0.189], [0.349, 0.686, 0.168], [0.272, 0.534, 0.131]])"#,
        r#"ColorMatrix(image: "grey", matrix: [[0.5, 0.25, 0.25], [0, 1, 0], [0.2, 0.2, 0.6]])"#,
    ],
);

impl ColorMatrix {
    /// As 4×4.
    fn rows(&self) -> [[f32; 4]; 4] {
        let mut rows = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        for (row, from) in rows.iter_mut().zip(&self.matrix) {
            row[..from.len()].copy_from_slice(from);
        }
        rows
    }

    /// Whether grey does not stay grey, beyond rounding.
    fn tints(&self) -> bool {
        let rows = self.rows();
        let of_grey = |row: &[f32; 4]| [row[0] + row[1] + row[2], row[3]];
        let red = of_grey(&rows[0]);
        let alike = rows[1..3].iter().map(of_grey).all(|v| (v[0] - red[0]).abs() < 1e-5 && (v[1] - red[1]).abs() < 1e-5);
        !alike || rows[3] != [0.0, 0.0, 0.0, 1.0]
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
        tinted(inputs, &self.image, self.tints())
    }

    fn makes_alpha(&self) -> bool {
        self.rows()[3] != [0.0, 0.0, 0.0, 1.0]
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let [r, g, b, a] = self.rows();
        point(cx, &self.image, shader!("colour/color_matrix")).param("r", r).param("g", g).param("b", b).param("a", a).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let rows = self.rows();
        let times = |p: [f64; 4]| rows.map(|row| row.iter().zip(p).map(|(m, v)| f64::from(*m) * v).sum());
        vec![Tensor::Image(image.map(tinted_channels(image.channels, self.tints()), times))]
    }
}
