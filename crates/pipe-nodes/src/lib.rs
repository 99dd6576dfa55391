//! The node library of `pipe`: one file a node.
//!
//! A node is a struct. Its fields are its parameters and ports: their types, defaults, ranges, units and doc
//! comments are at once the parser, the error texts, the reference page and the JSON schema. `lower` declares
//! its passes, `reference` is its twin in double precision, and its shader of the same name lies in `shaders/`.
//! Nodes never see each other; what several share stands in a file named by its noun beside them.
//!
//! To add one: write `src/<section>/<node>.rs` and `shaders/<section>/<node>.wgsl`, then name it in the section's
//! `mod.rs`. Tests that walk the registry do the rest. `colour/exposure.rs` is a node of one point pass,
//! `filters/blur.rs` one of stencil passes.

pub mod analysis;
pub mod colour;
mod components;
pub mod composite;
pub mod filters;
pub mod reference;
pub mod simulation;
pub mod sources;
pub mod structure;
pub mod volumes;

use pipe_graph::node::Registry;

/// The built-in shader of this path below `shaders/`, without its ending.
macro_rules! shader {
    ($path:literal) => {
        pipe_graph::pass::Shader::builtin(
            concat!($path, ".wgsl"),
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/", $path, ".wgsl")),
        )
    };
}
pub(crate) use shader;

/// Every node kind.
pub const REGISTRY: Registry = Registry::new(&[
    filters::KINDS,
    colour::KINDS,
    composite::KINDS,
    analysis::KINDS,
    simulation::KINDS,
    volumes::KINDS,
    sources::KINDS,
    structure::KINDS,
]);
