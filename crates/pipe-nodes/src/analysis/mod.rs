//! Analysis and tables.

use pipe_graph::node::Kind;

mod bins;
mod equalize;
mod histogram;
mod normalize;
mod prefix;
mod pyramid_average;
mod quantile;
pub(crate) mod reduction;
mod sat;
mod scan;
mod stats;
mod summed_area;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[
    pyramid_average::KIND,
    stats::KIND,
    histogram::KIND,
    scan::KIND,
    equalize::KIND,
    sat::KIND,
    normalize::KIND,
];
