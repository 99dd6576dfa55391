//! `Sobel`: gradients.

use pipe_graph::prelude::*;

use crate::shader;

/// Sobel's gradients: `gx` = [[−1, 0, 1], [−2, 0, 2], [−1, 0, 1]] and `gy`, its transpose, as correlations (so that gx is
/// positive where values grow to the right, gy where they grow downwards); `out` is √(gx² + gy²). Per channel; alpha 1.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Sobel {
    /// The image.
    image: In<Image>,
}

pub(super) const KIND: Kind = Kind::of::<Sobel>("Sobel", Category::Filters, &[r#"Sobel(image: "in")"#, r#"Sobel(image: "grey")"#])
    .ports(&[("out", "the magnitude"), ("gx", "the derivative along x, times 8"), ("gy", "the derivative along y, times 8")])
    .tolerance(1e-5, 1e-5);

impl Node for Sobel {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let ty = EdgeType::Image(inputs.image(&self.image));
        Ok(["out", "gx", "gy"].into_iter().map(|name| Output::new(name, ty)).collect())
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        let (out, gx, gy) = (cx.output("out"), cx.output("gx"), cx.output("gy"));
        cx.pass("", shader!("filters/sobel"))
            .entry(Entry::Each)
            .read("image", image, Reach::Around(1, 1))
            .write("out", out)
            .write("gx", gx)
            .write("gy", gy)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let gradient = |horizontal: bool| {
            Raster::from_fn(image.size, image.channels, |x, y| {
                let mut sum = [0.0; 4];
                for along in -1..=1_i64 {
                    for across in -1..=1_i64 {
                        let w = along as f64 * (2 - across.abs()) as f64;
                        let (dx, dy) = if horizontal { (along, across) } else { (across, along) };
                        let p = image.load(x + dx, y + dy, cx.border);
                        for c in 0..4 {
                            sum[c] += w * p[c];
                        }
                    }
                }
                [sum[0], sum[1], sum[2], 1.0]
            })
        };
        let (gx, gy) = (gradient(true), gradient(false));
        let out = Raster::from_fn(image.size, image.channels, |x, y| {
            let (a, b) = (gx.at(x, y), gy.at(x, y));
            [a[0].hypot(b[0]), a[1].hypot(b[1]), a[2].hypot(b[2]), 1.0]
        });
        vec![Tensor::Image(out), Tensor::Image(gx), Tensor::Image(gy)]
    }
}
