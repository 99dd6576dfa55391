//! Filters.

mod bloom;
mod blur;
mod box_blur;
mod convolve;
pub(crate) mod gaussian;
mod gaussian_blur;
mod importance;
mod recursive;
mod sobel;
mod unsharp_mask;

use pipe_graph::node::Kind;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[
    blur::BLUR_H,
    blur::BLUR_V,
    gaussian_blur::KIND,
    importance::KIND,
    convolve::KIND,
    box_blur::KIND,
    unsharp_mask::KIND,
    sobel::KIND,
    bloom::KIND,
];
