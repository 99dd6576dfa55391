//! `Convolve`: any small kernel.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// Convolves with a kernel: out(x, y) = Σ k(i, j)·in(x − i, y − j), the kernel's centre at 0.
///
/// It is a convolution, not a correlation: the kernel is turned by 180°. `[[1, 2, 1], [2, 4, 2], [1, 2, 1]]` is the binomial.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Convolve {
    /// The image.
    image: In<Image>,
    /// Rows of the kernel from the top; odd × odd, at most 65 × 65.
    #[default(vec![vec![1.0, 2.0, 1.0], vec![2.0, 4.0, 2.0], vec![1.0, 2.0, 1.0]])]
    kernel: Vec<Vec<f32>>,
    /// Divides by the kernel's sum, when that is not 0.
    #[default = true]
    normalize: bool,
}

pub(super) const KIND: Kind = Kind::of::<Convolve>(
    "Convolve",
    Category::Filters,
    &[
        r#"Convolve(image: "in", kernel: [[1, 2, 1], [2, 4, 2], [1, 2, 1]])"#,
        r#"Convolve(image: "grey", kernel: [[0, 1, 2, 3, 4]], normalize: false)"#,
        r#"Convolve(image: "in", kernel: [[0, -1, 0], [-1, 4, -1], [0, -1, 0]])"#,
        r#"Convolve(image: "in", kernel: [[1, 2, 3], [4, 5, 6], [7, 8, 9], [1, 0, 1], [0, 2, 0]])"#,
    ],
)
.tolerance(1e-5, 1e-5);

impl Convolve {
    /// Width, height and weights, rows from the top.
    fn weights(&self) -> (usize, usize, Vec<f64>) {
        let raw: Vec<f64> = self.kernel.iter().flatten().map(|w| f64::from(*w)).collect();
        let sum: f64 = raw.iter().sum();
        let scale = if self.normalize && sum != 0.0 { 1.0 / sum } else { 1.0 };
        (self.kernel[0].len(), self.kernel.len(), raw.into_iter().map(|w| w * scale).collect())
    }
}

impl Node for Convolve {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        let (h, w) = (self.kernel.len(), self.kernel.first().map_or(0, Vec::len));
        if h % 2 == 0 || w % 2 == 0 || h > 65 || w > 65 || self.kernel.iter().any(|row| row.len() != w) {
            return Err(Mistake::in_field("kernel", format!("is {w}x{h}")).hint("expected rows of one length, odd × odd, at most 65 × 65"));
        }
        Ok(())
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let (w, h, weights) = self.weights();
        let table = cx.floats("kernel", &weights.iter().map(|w| *w as f32).collect::<Vec<_>>());
        cx.pass("", shader!("filters/convolve"))
            .read("image", image, Reach::Around(w as u32 / 2, h as u32 / 2))
            .read("kernel", table, Reach::Whole)
            .write("out", out)
            .constant("RX", (w / 2) as i32)
            .constant("RY", (h / 2) as i32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let (w, h, weights) = self.weights();
        let (rx, ry) = ((w / 2) as i64, (h / 2) as i64);
        vec![Tensor::Image(Raster::from_fn(image.size, image.channels, |x, y| {
            let mut sum = [0.0; 4];
            for j in -ry..=ry {
                for i in -rx..=rx {
                    let k = weights[((j + ry) as usize) * w + (i + rx) as usize];
                    let p = image.load(x - i, y - j, cx.border);
                    for c in 0..4 {
                        sum[c] += k * p[c];
                    }
                }
            }
            sum
        }))]
    }
}
