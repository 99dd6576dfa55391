//! Composite and geometry.

mod arithmetic;
mod blend;
mod copy_region;
mod crop;
mod displace;
mod expr;
mod flip;
mod math;
mod merge;
mod mix;
mod offset;
mod pad;
mod pair;
mod resampling;
mod resize;
mod rotate90;
mod sample_image;
mod st_map;
mod tile;
mod transform;

use pipe_graph::node::Kind;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[
    blend::KIND,
    merge::KIND,
    mix::KIND,
    math::KIND,
    expr::KIND,
    copy_region::KIND,
    crop::KIND,
    pad::KIND,
    flip::KIND,
    rotate90::KIND,
    offset::KIND,
    tile::KIND,
    resize::KIND,
    transform::KIND,
    displace::KIND,
    st_map::KIND,
    sample_image::KIND,
];
