//! What loops begin with.

use pipe_graph::prelude::*;

use crate::shader;

/// An image as a state (u, v) in 32-bit floats; it is taken as it is when it has that form. One channel is u at rest.
pub(super) fn begin(cx: &mut Lowering<'_>, image: ResourceId) -> ResourceId {
    let ty = cx.image_of(image);
    let shape = Shape::image(ty.size, 2);
    if cx.shape(image) == shape {
        return image;
    }
    let state = cx.intermediate("begin", shape);
    cx.pass("begin", shader!("simulation/wave_begin"))
        .entry(Entry::Point)
        .read("image", image, Reach::Point)
        .write("out", state)
        .constant("AT_REST", ty.channels == 1)
        .add();
    state
}

/// An image in 32-bit floats, with its own channels.
pub(crate) fn widened(cx: &mut Lowering<'_>, image: ResourceId) -> ResourceId {
    let ty = cx.image_of(image);
    let shape = Shape::image(ty.size, ty.channels);
    if cx.shape(image) == shape {
        return image;
    }
    let state = cx.intermediate("begin", shape);
    cx.pass("begin", shader!("simulation/copy")).entry(Entry::Point).read("image", image, Reach::Point).write("out", state).add();
    state
}
