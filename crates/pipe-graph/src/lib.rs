//! The graph language of `pipe`: text in, a checked graph out, and the vocabulary in which nodes declare work.
//!
//! No GPU, and no files beyond the [`node::Loader`] trait. Read in this order: [`types`] (what edges carry),
//! [`node`] (what a node is), [`pass`] (what a node asks of the GPU), [`document`] and [`resolve`] (the stages).

pub mod de;
pub mod diagnostic;
pub mod document;
pub mod expr;
pub mod field;
pub mod graph;
pub mod lowering;
pub mod node;
pub mod pass;
pub mod reference;
pub mod resolve;
pub mod rim;
pub mod span;
pub mod structure;
pub mod syntax;
pub mod types;
pub mod wgsl;

/// What a node file needs.
pub mod prelude {
    pub use schemars::JsonSchema;
    pub use serde::{Deserialize, Serialize};

    pub use crate::field::{Any, Array, Driven, EdgeOr, Image, ImageOrTable, ImageOrVolume, In, Mesh, Operand, Scalar, Table, Volume};
    pub use crate::lowering::{Carried, Lowering, MeshParts};
    pub use crate::node::{Category, FileElement, FileSource, Inputs, Kind, Mistake, Node, Opening, Output, Port, ReadbackFile, TableFile};
    pub use crate::pass::{
        Access, Border, Constant, Count, Entry, Filter, Grid, Profile, Reach, ResourceId, Shader, Shape, Stretch, Value, Values, Walk,
        Workspace,
    };
    pub use crate::reference::{Block, Raster, Reference, Tensor, Triangles, luminance, narrow};
    pub use crate::types::{EdgeKind, EdgeType, Element, ImageType, MeshType, Precision, ScalarType, TableType, VolumeType};
}
