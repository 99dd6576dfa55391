//! Colour and tone.

mod cdl;
mod clamp;
mod color_matrix;
mod colorspace;
mod curve;
mod exposure;
mod gamma;
mod grade;
mod hue_shift;
mod invert;
mod levels;
mod luminance;
pub(crate) mod point;
mod posterize;
mod premultiply;
mod quantize;
mod saturation;
mod shuffle;
mod tone_map;
mod unpremultiply;

use pipe_graph::node::Kind;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[
    exposure::KIND,
    grade::KIND,
    cdl::KIND,
    levels::KIND,
    saturation::KIND,
    hue_shift::KIND,
    invert::KIND,
    gamma::KIND,
    clamp::KIND,
    color_matrix::KIND,
    colorspace::KIND,
    shuffle::KIND,
    premultiply::KIND,
    unpremultiply::KIND,
    luminance::KIND,
    tone_map::TONE_MAP,
    tone_map::SCALE_LUMINANCE,
    tone_map::REINHARD_CURVE,
    quantize::KIND,
    posterize::KIND,
];
