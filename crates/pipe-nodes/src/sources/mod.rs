//! Sources.

mod canvas;
mod checkerboard;
mod color_bars;
mod constant;
mod impulse;
mod noise;
mod ramp;
mod read;
mod zone_plate;

use pipe_graph::node::Kind;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[
    constant::KIND,
    ramp::KIND,
    checkerboard::KIND,
    noise::KIND,
    zone_plate::KIND,
    impulse::KIND,
    color_bars::KIND,
    read::READ_IMAGE,
    read::READ_VOLUME,
    read::READ_TABLE,
];
