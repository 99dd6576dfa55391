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

/// Channels of the image in which the state of a node leaves that began with an image of so many: as many, so that loops of
/// `Iterate`, `Feedback` and `repeat` close; a pair where u alone came in.
pub(super) fn channels(begun: u8) -> u8 {
    begun.max(2)
}

/// Lets a state (u, v) leave by the port `out`, behind zeros in blue and with an alpha of 1 where four channels are to leave.
pub(super) fn leave(cx: &mut Lowering<'_>, state: ResourceId, channels: u8) {
    if channels == 2 {
        cx.emit("out", state);
        return;
    }
    let out = cx.output("out");
    cx.pass("leave", shader!("simulation/copy")).entry(Entry::Point).read("image", state, Reach::Point).write("out", out).add();
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
