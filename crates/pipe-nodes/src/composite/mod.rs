//! Composite and geometry.

mod arithmetic;
mod blend;
mod crop;
mod flip;
mod math;
mod merge;
mod mix;
mod offset;
mod pad;
mod rotate90;
mod tile;

use pipe_graph::node::Kind;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[
    blend::KIND,
    merge::KIND,
    mix::KIND,
    math::KIND,
    crop::KIND,
    pad::KIND,
    flip::KIND,
    rotate90::KIND,
    offset::KIND,
    tile::KIND,
];
