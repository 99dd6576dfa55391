//! Analysis and tables.

use pipe_graph::node::Kind;

mod bins;
mod box_from_sat;
mod equalize;
mod histogram;
mod histogram2d;
mod normalize;
mod prefix;
mod pyramid_average;
mod quantile;
pub(crate) mod reduction;
mod sat;
mod sat_average;
mod scan;
mod scope;
mod stats;
mod summed_area;
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
    sat::KIND,
    box_from_sat::KIND,
    normalize::KIND,
];
