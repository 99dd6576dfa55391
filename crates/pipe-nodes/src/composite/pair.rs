//! A parameter that is one number for both axes, or a number for each.

use pipe_graph::prelude::*;
use schemars::{Schema, SchemaGenerator, json_schema};

/// `s`, or `(sx, sy)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(super) enum Pair {
    /// The same along x and y.
    Both(f32),
    /// One along x, one along y.
    Each(f32, f32),
}

impl Pair {
    /// The numbers along x and y.
    pub(super) fn xy(self) -> [f64; 2] {
        match self {
            Self::Both(v) => [f64::from(v); 2],
            Self::Each(x, y) => [f64::from(x), f64::from(y)],
        }
    }
}

impl JsonSchema for Pair {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Pair".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["number", "array"], "items": { "type": "number" }, "minItems": 2, "maxItems": 2 })
    }
}
