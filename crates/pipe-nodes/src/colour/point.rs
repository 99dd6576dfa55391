//! What nodes of one point pass share: an image in, an image of the same size out.

use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;

/// The single output, of the input's type.
pub(crate) fn same(inputs: &Inputs<'_>, image: &In<Image>) -> Result<Vec<Output>, Mistake> {
    Ok(Output::out(EdgeType::Image(inputs.image(image))))
}

/// The single output of a node that may treat channels differently: then grey becomes colour.
pub(crate) fn tinted(inputs: &Inputs<'_>, image: &In<Image>, tints: bool) -> Result<Vec<Output>, Mistake> {
    let ty = inputs.image(image);
    Ok(Output::out(EdgeType::Image(ty.with_channels(tinted_channels(ty.channels, tints)))))
}

/// The channels of what such a node makes.
pub(crate) const fn tinted_channels(channels: u8, tints: bool) -> u8 {
    if tints && channels == 1 { 4 } else { channels }
}

/// Lets the image leave as it is, if it is `neutral` to do so and no other type is asked for. Answers whether it left.
pub(crate) fn untouched(cx: &mut Lowering<'_>, image: &In<Image>, neutral: bool) -> bool {
    let image = cx.input(image);
    neutral && cx.pass_on("out", image)
}

/// A point pass from `image` to `out`; parameters are to be added.
pub(crate) fn point<'b, 'a>(cx: &'b mut Lowering<'a>, image: &In<Image>, shader: Shader) -> PassBuilder<'b, 'a> {
    let (image, out) = (cx.input(image), cx.output("out"));
    cx.pass("", shader).entry(Entry::Point).read("image", image, Reach::Point).write("out", out)
}

/// The twin of a point pass: colour through `f`, alpha kept.
pub(crate) fn map_rgb(cx: &Reference<'_>, image: &In<Image>, f: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<Tensor> {
    map_tinted(cx, image, false, f)
}

/// The twin of a point pass that may treat channels differently.
pub(crate) fn map_tinted(cx: &Reference<'_>, image: &In<Image>, tints: bool, f: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<Tensor> {
    let image = cx.image(image);
    vec![Tensor::Image(image.map(tinted_channels(image.channels, tints), |[r, g, b, a]| {
        let [r, g, b] = f([r, g, b]);
        [r, g, b, a]
    }))]
}
