//! Fields of the kinds that shape a graph and never become passes themselves: the resolver takes them apart.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::field::{Any, In};

/// Puts another graph file in place of a node. Its outputs are ports; instances have private names.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Subgraph {
    /// Path of the graph, relative to the file that names it; a bare name finds a preset.
    pub file: String,
    /// What its inputs are bound to: `{"in": "blurred"}`.
    pub inputs: IndexMap<String, In<Any>>,
    /// Values of its parameters: numbers, `true` or `false`, or expressions over the outer parameters.
    pub params: IndexMap<String, ParameterValue>,
}

/// The value of a parameter of a subgraph.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ParameterValue {
    /// Of a `Bool`.
    Flag(bool),
    /// Of any other.
    Number(f64),
}

/// Runs a body again and again; output ports are the state names. State is ping-ponged, nothing is copied.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Iterate {
    /// States by name, with the edge that each one starts from: `{"u": "seed"}`.
    pub state: IndexMap<String, In<Any>>,
    /// How often the body runs. Either this or `until`.
    pub count: Option<u32>,
    /// The condition that ends it: `Below(value: "residual", limit: 1e-5, every: 16)`; `value` names a `Scalar` of the body.
    pub until: Option<Until>,
    /// The most iterations of an `until`.
    #[default = 100_000]
    #[schemars(range(min = 1, max = 1_000_000_000))]
    pub max: u32,
}

/// When an `Iterate` ends early.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub enum Until {
    /// When the first component of `value` is below `limit`, checked every `every` iterations.
    Below {
        /// A `Scalar` of the body.
        value: String,
        /// The bound.
        limit: f32,
        /// Iterations between checks.
        #[serde(default = "one")]
        every: u32,
    },
}

const fn one() -> u32 {
    1
}

/// The value that `next` had `delay` frames ago; `init` before that.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Feedback {
    /// Its value in the first frames.
    pub init: In<Any>,
    /// The edge whose value is kept; it may depend on this node.
    pub next: String,
    /// Frames between, 1 to 64.
    #[default = 1]
    #[schemars(range(min = 1, max = 64), extend("x-unit" = "frames"))]
    pub delay: u32,
}
