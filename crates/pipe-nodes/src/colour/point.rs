//! What nodes of one point pass share: an image in, an image of the same size out.

use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;

/// The single output, of the input's type.
pub(crate) fn same(inputs: &Inputs<'_>, image: &In<Image>) -> Result<Vec<Output>, Mistake> {
    Ok(Output::out(EdgeType::Image(inputs.image(image))))
}

/// A point pass from `image` to `out`; parameters are to be added.
pub(crate) fn point<'b, 'a>(cx: &'b mut Lowering<'a>, image: &In<Image>, shader: Shader) -> PassBuilder<'b, 'a> {
    let (image, out) = (cx.input(image), cx.output("out"));
    cx.pass("", shader).entry(Entry::Point).read("image", image, Reach::Point).write("out", out)
}

/// The twin of a point pass: colour through `f`, alpha kept.
pub(crate) fn map_rgb(cx: &Reference<'_>, image: &In<Image>, f: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<Tensor> {
    let image = cx.image(image);
    vec![Tensor::Image(image.map(image.channels, |[r, g, b, a]| {
        let [r, g, b] = f([r, g, b]);
        [r, g, b, a]
    }))]
}
