//! Filters.

mod anisotropic_diffusion;
mod bilateral;
mod bloom;
mod blur;
mod box_blur;
mod convolve;
mod difference_of_gaussians;
pub(crate) mod gaussian;
mod gaussian_blur;
mod guided;
mod importance;
mod laplacian;
mod median;
mod morphology;
mod pyramid;
mod recursive;
mod selection_network;
mod sobel;
mod structuring_element;
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
    median::KIND,
    bilateral::KIND,
    guided::KIND,
    unsharp_mask::KIND,
    sobel::KIND,
    laplacian::KIND,
    difference_of_gaussians::KIND,
    morphology::DILATE,
    morphology::ERODE,
    morphology::OPEN,
    morphology::CLOSE,
    bloom::KIND,
    anisotropic_diffusion::KIND,
];
