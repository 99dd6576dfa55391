//! Analysis and tables.

use pipe_graph::node::Kind;

mod bins;
mod box_from_sat;
mod clahe;
mod compare;
mod equalize;
mod flip;
mod histogram;
mod histogram2d;
mod histogram_match;
mod normalize;
pub(crate) mod prefix;
mod pyramid_average;
mod quantile;
pub(crate) mod reduction;
mod sat;
mod sat_average;
mod scan;
mod scope;
mod ssim;
mod stats;
mod summed_area;
mod threshold;
mod vectorscope;
mod waveform;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[
    pyramid_average::KIND,
    sat_average::KIND,
    stats::KIND,
    histogram::KIND,
    histogram2d::KIND,
    waveform::KIND,
    vectorscope::KIND,
    scan::KIND,
    equalize::KIND,
    histogram_match::KIND,
    clahe::KIND,
    sat::KIND,
    box_from_sat::KIND,
    compare::KIND,
    normalize::KIND,
    threshold::KIND,
];
