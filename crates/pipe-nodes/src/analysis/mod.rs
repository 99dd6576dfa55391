//! Analysis and tables.

use pipe_graph::node::Kind;

pub(crate) mod reduction;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[];
