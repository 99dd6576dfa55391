//! Colour and tone.

mod blue_noise;
mod cdl;
mod clamp;
mod color_matrix;
mod colormap;
mod colorspace;
mod cube;
mod curve;
mod curves;
mod dither;
mod exposure;
mod gamma;
mod grade;
mod hue_shift;
mod invert;
mod levels;
mod luminance;
mod lut3d;
pub(crate) mod point;
mod posterize;
mod premultiply;
mod primaries;
mod quantize;
mod saturation;
mod shuffle;
mod tone_map;
mod unpremultiply;
mod white_balance;

use pipe_graph::node::Kind;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[
    exposure::KIND,
    grade::KIND,
    cdl::KIND,
    levels::KIND,
    curves::KIND,
    saturation::KIND,
    hue_shift::KIND,
    white_balance::KIND,
    invert::KIND,
    gamma::KIND,
    clamp::KIND,
    color_matrix::KIND,
    colorspace::KIND,
    lut3d::KIND,
    shuffle::KIND,
    premultiply::KIND,
    unpremultiply::KIND,
    luminance::KIND,
    tone_map::TONE_MAP,
    tone_map::SCALE_LUMINANCE,
    tone_map::REINHARD_CURVE,
    quantize::KIND,
    dither::KIND,
    posterize::KIND,
    colormap::KIND,
];
