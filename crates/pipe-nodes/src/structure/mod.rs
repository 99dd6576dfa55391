//! Structure.

mod readback;
mod switch;
mod wgsl;

use pipe_graph::node::Kind;
use pipe_graph::structure::{Feedback, Iterate, Subgraph};

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] = &[
    Kind::structure::<Subgraph>("Subgraph", &[r#"Subgraph(file: "tone-map.ron", inputs: {"in": "blurred"}, params: {"key": 0.3})"#]),
    Kind::structure::<Iterate>(
        "Iterate",
        &[r#"Iterate(state: {"u": "in"}, body: {"step": BoxBlur(image: "u", radius: 1)}, next: {"u": "step"}, count: 10)"#],
    ),
    Kind::structure::<Feedback>("Feedback", &[r#"Feedback(init: "in", next: "mixed", delay: 1)"#]),
    switch::KIND,
    readback::KIND,
    wgsl::KIND,
];
