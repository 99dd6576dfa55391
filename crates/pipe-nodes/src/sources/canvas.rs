//! What all sources share: a size, and a pass without inputs.

use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;

use crate::components::Size;

/// Width and height of a source when none is given.
pub(super) const SIZE: Size = Size([512, 512]);

/// An image of this size, or what is wrong with it.
pub(super) fn image(Size(size): Size, channels: u8) -> Result<Vec<Output>, Mistake> {
    if size.contains(&0) {
        return Err(Mistake::in_field("size", "has no pixels").hint("expected (width, height), each at least 1"));
    }
    Ok(Output::out(EdgeType::image(size, channels)))
}

/// A point pass without inputs.
pub(super) fn paint<'b, 'a>(cx: &'b mut Lowering<'a>, shader: Shader) -> PassBuilder<'b, 'a> {
    let out = cx.output("out");
    cx.pass("", shader).entry(Entry::Point).write("out", out)
}
