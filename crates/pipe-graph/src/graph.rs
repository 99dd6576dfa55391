//! The graph: what a document means.
//!
//! **Invariants** that holding a [`Graph`] proves (only [`crate::resolve`] makes one): it is acyclic, every input
//! is bound to an output of an accepted kind, and every type, size and precision is known. Subgraphs are gone,
//! their nodes stand here under private names (`glow/blur`); iterations keep their body as a graph of its own.

use std::fmt;
use std::sync::Arc;

use indexmap::IndexMap;
use petgraph::graph::{DiGraph, NodeIndex};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::node::{Node, Output};
use crate::pass::{Border, Filter};
use crate::span::Span;
use crate::types::EdgeType;

/// An output port of an instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ValueRef {
    /// The instance.
    pub node: NodeIndex,
    /// Position of the port in [`Instance::outputs`].
    pub port: usize,
}

/// What a DAG edge says: which port feeds which input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wire {
    /// Position of the port at the source.
    pub port: usize,
    /// Position of the edge at the target.
    pub input: usize,
}

/// Storage precision asked for by the user.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub enum Format {
    /// 32-bit float.
    F32,
    /// 16-bit float storage of the node's images.
    F16,
    /// The planner's choice: whatever loses nothing.
    #[default]
    Auto,
}

/// Options that every node takes.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Options {
    /// Storage precision of the node's images.
    pub format: Format,
    /// What lies outside an image.
    pub border: Border,
    /// How images are read between pixel centres.
    pub filter: Filter,
    /// How often the node runs, its output fed back into its first input (ping-pong); 1 when absent.
    pub repeat: Option<u32>,
    /// `false` bypasses the node: its first input passes through.
    pub when: Option<bool>,
    /// Writes the first output to this file, as a `Readback` node would.
    pub readback: Option<String>,
}

/// When an iteration ends.
#[derive(Debug, Clone, PartialEq)]
pub enum Times {
    /// After so many.
    Fixed(u32),
    /// When the first component of `value` is below `limit`.
    Until {
        /// A scalar of the body.
        value: ValueRef,
        /// The bound.
        limit: f32,
        /// Iterations between checks.
        every: u32,
        /// The most iterations.
        max: u32,
    },
}

/// An `Iterate` node: inputs are the initial states, then what the body captures from outside.
#[derive(Debug, Clone)]
pub struct Iteration {
    /// The body; its `State` and `Capture` instances stand for the inputs.
    pub body: Graph,
    /// What each state becomes, in the body.
    pub next: Vec<ValueRef>,
    /// How often.
    pub times: Times,
}

/// What an instance does.
#[derive(Debug, Clone)]
pub enum Work {
    /// A graph input.
    Input,
    /// A node of the library.
    Node(Arc<dyn Node>),
    /// A loop.
    Iterate(Box<Iteration>),
    /// `Feedback`: its input is the initial value.
    Feedback {
        /// The value that is kept; set once everything is resolved.
        next: ValueRef,
        /// Frames between.
        delay: u32,
    },
    /// In a body: the n-th state.
    State(usize),
    /// In a body: the n-th captured value.
    Capture(usize),
}

/// One node of the graph.
#[derive(Debug, Clone)]
pub struct Instance {
    /// Private name: `glow/blur`.
    pub name: String,
    /// Its kind.
    pub kind: &'static str,
    /// Where it was written.
    pub span: Span,
    /// What it does.
    pub work: Work,
    /// One value for each edge of the node.
    pub inputs: Vec<ValueRef>,
    /// Output ports.
    pub outputs: Vec<Output>,
    /// Options.
    pub options: Options,
}

/// What a graph means.
#[derive(Debug, Clone)]
pub struct Graph {
    /// Its name.
    pub name: String,
    pub(crate) dag: DiGraph<Instance, Wire>,
    pub(crate) order: Vec<NodeIndex>,
    pub(crate) inputs: IndexMap<String, NodeIndex>,
    pub(crate) outputs: IndexMap<String, ValueRef>,
}

impl Graph {
    /// The DAG itself.
    pub fn dag(&self) -> &DiGraph<Instance, Wire> {
        &self.dag
    }

    /// Instances, each after those it reads; the order depends on names only, not on the order in the file.
    pub fn iter(&self) -> impl Iterator<Item = (NodeIndex, &Instance)> {
        self.order.iter().map(|i| (*i, &self.dag[*i]))
    }

    /// One instance.
    pub fn instance(&self, node: NodeIndex) -> &Instance {
        &self.dag[node]
    }

    /// The type of a value.
    pub fn ty(&self, value: ValueRef) -> EdgeType {
        self.dag[value.node].outputs[value.port].ty
    }

    /// Graph inputs by name.
    pub fn inputs(&self) -> impl Iterator<Item = (&str, EdgeType)> {
        self.inputs.iter().map(|(name, node)| (name.as_str(), self.dag[*node].outputs[0].ty))
    }

    /// Graph outputs by name.
    pub fn outputs(&self) -> impl Iterator<Item = (&str, ValueRef)> {
        self.outputs.iter().map(|(name, value)| (name.as_str(), *value))
    }

    /// The value of a private node name with an optional port: `glow/blur.out`. For `--dump`.
    pub fn find(&self, text: &str) -> Option<ValueRef> {
        let find = |name: &str| self.iter().find(|(_, i)| i.name == name);
        if let Some((node, instance)) = find(text) {
            return (!instance.outputs.is_empty()).then_some(ValueRef { node, port: 0 });
        }
        let (name, port) = text.rsplit_once('.')?;
        let (node, instance) = find(name)?;
        let port = instance.outputs.iter().position(|o| o.name == port)?;
        Some(ValueRef { node, port })
    }
}

impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(n) => write!(f, "{n} times"),
            Self::Until { limit, every, max, .. } => write!(f, "until below {limit}, checked every {every}, at most {max}"),
        }
    }
}
