//! What a node is: the one trait that every file in `pipe-nodes` implements, and its entry in the registry.

use std::fmt::Debug;
use std::path::Path;

use schemars::{JsonSchema, Schema, schema_for};
use serde::de::DeserializeOwned;

use crate::de::TreeDeserializer;
use crate::field::{Accepts, Driven, EdgeIndex, EdgeOr, Image, In, Operand, Table, Volume};
use crate::lowering::Lowering;
use crate::reference::{Reference, Tensor};
use crate::types::{EdgeType, ImageType, ScalarType, TableType, VolumeType};

/// Something wrong with one node, told by the node; the resolver adds the place.
#[derive(Debug, Clone, PartialEq)]
pub struct Mistake {
    /// The field at fault; the whole node when there is none.
    pub field: Option<String>,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub hint: Option<String>,
}

impl Mistake {
    /// A mistake of the whole node.
    pub fn new(message: impl Into<String>) -> Self {
        Self { field: None, message: message.into(), hint: None }
    }

    /// A mistake in one field.
    pub fn in_field(field: impl Into<String>, message: impl Into<String>) -> Self {
        Self { field: Some(field.into()), message: message.into(), hint: None }
    }

    /// Adds the next step.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

/// An output port and its type.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    /// The name after the dot in `"node.port"`; the first output needs none.
    pub name: String,
    /// Its type.
    pub ty: EdgeType,
}

impl Output {
    /// A port.
    pub fn new(name: impl Into<String>, ty: EdgeType) -> Self {
        Self { name: name.into(), ty }
    }

    /// The single port `out`.
    pub fn out(ty: EdgeType) -> Vec<Self> {
        vec![Self::new("out", ty)]
    }
}

/// The types that arrive at a node's inputs.
#[derive(Debug)]
pub struct Inputs<'a> {
    /// One type for each of the node's edges.
    pub types: &'a [EdgeType],
    /// Warnings that the node wants the user to see.
    pub warnings: &'a mut Vec<Mistake>,
}

impl Inputs<'_> {
    /// The type at any port.
    pub fn ty(&self, edge: EdgeIndex) -> EdgeType {
        self.types[edge.0 as usize]
    }

    /// The type at a bound image port (the resolver has checked the kind).
    pub fn image(&self, port: &In<Image>) -> ImageType {
        as_image(self.ty(port.edge))
    }

    /// The type at a bound volume port.
    pub fn volume(&self, port: &In<Volume>) -> VolumeType {
        as_volume(self.ty(port.edge))
    }

    /// The type at a bound table port.
    pub fn table(&self, port: &In<Table>) -> TableType {
        as_table(self.ty(port.edge))
    }

    /// The common size and the larger channel count of several images, or what to say when sizes differ.
    pub fn same_size(&self, ports: &[(&str, &In<Image>)]) -> Result<ImageType, Mistake> {
        let mut all = ports.iter().map(|(name, port)| (*name, self.image(port)));
        let Some((first, mut joined)) = all.next() else {
            return Err(Mistake::new("has no image input"));
        };
        for (name, t) in all {
            if t.size != joined.size {
                let ([w, h], [fw, fh]) = (t.size, joined.size);
                return Err(Mistake::in_field(name, format!("is {w}x{h}, but `{first}` is {fw}x{fh}"))
                    .hint("bring them to one size with Resize, Crop or Pad"));
            }
            joined.channels = joined.channels.max(t.channels);
        }
        Ok(joined)
    }

    /// Tells the user something that is not an error.
    pub fn warn(&mut self, warning: Mistake) {
        self.warnings.push(warning);
    }
}

pub(crate) fn as_image(ty: EdgeType) -> ImageType {
    match ty {
        EdgeType::Image(t) => t,
        other => unreachable!("the resolver bound {other} to an image port"),
    }
}

pub(crate) fn as_volume(ty: EdgeType) -> VolumeType {
    match ty {
        EdgeType::Volume(t) => t,
        other => unreachable!("the resolver bound {other} to a volume port"),
    }
}

pub(crate) fn as_table(ty: EdgeType) -> TableType {
    match ty {
        EdgeType::Table(t) => t,
        other => unreachable!("the resolver bound {other} to a table port"),
    }
}

/// What the world outside looks like to the checker: enough to know every size before anything runs.
/// Paths are already joined to the folder of the file that names them. Errors are sentences for the user.
pub trait Loader {
    /// A text file of at most so many bytes: a graph, a shader, a LUT. No more than that is read, for a path may name what never
    /// ends.
    fn text(&self, path: &Path, most: usize) -> Result<String, String>;
    /// The type of an image file, from its header.
    fn image(&self, path: &Path) -> Result<ImageType, String>;
    /// The type of a volume file, from its header.
    fn volume(&self, path: &Path) -> Result<VolumeType, String>;
    /// A table file, whole.
    fn table(&self, path: &Path) -> Result<TableFile, String>;
}

/// The content of a table file.
#[derive(Debug, Clone, PartialEq)]
pub enum TableFile {
    /// Floats.
    F32(Vec<f32>),
    /// Unsigned integers.
    U32(Vec<u32>),
}

/// What a node may look at when it is opened.
#[derive(Clone, Copy)]
pub struct Opening<'a> {
    /// Reads files.
    pub loader: &'a dyn Loader,
    /// Folder of the graph file that names the node.
    pub folder: &'a Path,
}

/// A file that a node wants decoded and uploaded by the caller.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum FileSource {
    /// An image, converted to working space like a graph input.
    Image(String),
    /// A volume.
    Volume(String),
}

/// The type of the values in a readback file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize, JsonSchema)]
#[allow(missing_docs)]
pub enum FileElement {
    U8,
    U16,
    I32,
    U32,
    F16,
    #[default]
    F32,
}

/// A file that a run writes beside the graph's outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadbackFile {
    /// Relative to the working directory; its ending says the format.
    pub path: String,
    /// Type of the values of an npy file.
    pub element: Option<FileElement>,
    /// Channels of an image, as positions 0..3; all when empty.
    pub channels: Vec<usize>,
    /// What is fetched: the size of the region of an image, a table, a scalar.
    pub ty: EdgeType,
}

/// One node of a graph with its parameters: a verb of the language.
///
/// Methods are called in this order: [`open`](Node::open), [`outputs`](Node::outputs), then
/// [`lower`](Node::lower); [`reference`](Node::reference) is the twin on the CPU.
pub trait Node: Debug + Send + Sync {
    /// Checks what field types cannot say and reads the files that the node needs for its shape.
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        Ok(())
    }

    /// The output ports; the first is the default. Sizes that do not fit together are found here.
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake>;

    /// The file that this node reads, if it is a file source; the lowering gets it as `cx.file()`.
    fn file(&self) -> Option<FileSource> {
        None
    }

    /// The file that a run writes with what this node fetches under its own name, given the types of its inputs.
    fn readback(&self, _: &[EdgeType]) -> Option<ReadbackFile> {
        None
    }

    /// Whether it may make alpha other than 1 from opaque images, other than by a transparent border: such a graph writes
    /// alpha to its outputs.
    fn makes_alpha(&self) -> bool {
        false
    }

    /// Declares passes, and which resource leaves by which port.
    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake>;

    /// The same node in double precision on the CPU, written from the formula of the reference and not from the
    /// shader: one tensor for each output port.
    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor>;
}

/// The section of the reference that a node stands in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[allow(missing_docs)]
pub enum Category {
    Filters,
    Colour,
    Composite,
    Analysis,
    Simulation,
    Volumes,
    Sources,
    Structure,
}

/// How far the GPU may be from the reference: |gpu − ref| ≤ absolute + relative·|ref|.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Tolerance {
    /// Absolute part.
    pub absolute: f64,
    /// Relative part.
    pub relative: f64,
    /// Share of the values that may be anything else: where chance decides by a comparison, rounding may decide otherwise.
    pub strays: f64,
}

impl Tolerance {
    /// Equal to the bit: integer work, copies.
    pub const EXACT: Self = Self { absolute: 0.0, relative: 0.0, strays: 0.0 };
    /// What 32-bit arithmetic gives without care: the default.
    pub const FLOAT: Self = Self { absolute: 1e-6, relative: 1e-5, strays: 0.0 };
}

/// A node kind as the registry knows it: everything that is not in the struct itself.
#[derive(Clone, Copy)]
pub struct Kind {
    /// The name that graph files use.
    pub name: &'static str,
    /// Section of the reference.
    pub category: Category,
    /// Output ports with a sentence each, the default one first.
    pub ports: &'static [(&'static str, &'static str)],
    /// Uses of the node, simplest first, each a RON value such as `Exposure(image: "in", ev: 1)`. Tests run
    /// every one against the reference. Edges that they may name: `in` and `other` (RGBA images of one size),
    /// `grey` (1 channel, the same size), `pair` (2 channels), `table` (256 u32), `curve` (64 f32), `scalar` (4),
    /// `volume` and `fog` (1 channel).
    pub examples: &'static [&'static str],
    /// Promised agreement with the reference on finite input.
    pub tolerance: Tolerance,
    /// JSON schema of the fields.
    pub schema: fn() -> Schema,
    /// Reads the fields.
    pub build: fn(TreeDeserializer<'_>) -> Result<Box<dyn Node>, crate::de::Error>,
}

impl Kind {
    /// The entry of the node type `T`, with the single port `out` and float tolerance.
    pub const fn of<T>(name: &'static str, category: Category, examples: &'static [&'static str]) -> Self
    where
        T: Node + DeserializeOwned + JsonSchema + 'static,
    {
        Self {
            name,
            category,
            ports: &[("out", "the result")],
            examples,
            tolerance: Tolerance::FLOAT,
            schema: || schema_for!(T),
            build: |d| T::deserialize(d).map(|node| Box::new(node) as Box<dyn Node>),
        }
    }

    /// With these output ports.
    #[must_use]
    pub const fn ports(mut self, ports: &'static [(&'static str, &'static str)]) -> Self {
        self.ports = ports;
        self
    }

    /// The entry of a kind that the resolver takes apart: it shapes the graph and never becomes a pass.
    pub const fn structure<T>(name: &'static str, examples: &'static [&'static str]) -> Self
    where
        T: DeserializeOwned + JsonSchema + 'static,
    {
        Self {
            name,
            category: Category::Structure,
            ports: &[],
            examples,
            tolerance: Tolerance::EXACT,
            schema: || schema_for!(T),
            build: |_| Err(serde::de::Error::custom("the resolver takes this kind apart")),
        }
    }

    /// With this tolerance.
    #[must_use]
    pub const fn tolerance(mut self, absolute: f64, relative: f64) -> Self {
        self.tolerance = Tolerance { absolute, relative, strays: 0.0 };
        self
    }

    /// With a share of values that may be outside the tolerance.
    #[must_use]
    pub const fn strays(mut self, share: f64) -> Self {
        self.tolerance.strays = share;
        self
    }
}

impl Debug for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Kind({})", self.name)
    }
}

/// All node kinds, by name.
#[derive(Debug, Clone, Copy)]
pub struct Registry {
    kinds: &'static [&'static [Kind]],
}

impl Registry {
    /// A registry of these groups of kinds.
    pub const fn new(kinds: &'static [&'static [Kind]]) -> Self {
        Self { kinds }
    }

    /// Every kind, in the order of the reference.
    pub fn iter(&self) -> impl Iterator<Item = &'static Kind> + use<> {
        self.kinds.iter().flat_map(|group| group.iter())
    }

    /// The kind of this name.
    pub fn get(&self, name: &str) -> Option<&'static Kind> {
        self.iter().find(|k| k.name == name)
    }
}

/// A port that may carry a number or an edge.
pub trait Port {
    /// The edge, if it is one.
    fn edge(&self) -> Option<EdgeIndex>;
}

impl<T: Accepts> Port for In<T> {
    fn edge(&self) -> Option<EdgeIndex> {
        self.is_bound().then_some(self.edge)
    }
}

impl<T: Accepts> Port for Option<In<T>> {
    fn edge(&self) -> Option<EdgeIndex> {
        self.as_ref().and_then(Port::edge)
    }
}

impl<E: Accepts, V> Port for EdgeOr<E, V> {
    fn edge(&self) -> Option<EdgeIndex> {
        match self {
            Self::Edge(port) => port.edge(),
            Self::Value(_) => None,
        }
    }
}

impl Port for Driven {
    fn edge(&self) -> Option<EdgeIndex> {
        match self {
            Self::Value(_) => None,
            Self::Scalar(port) => port.edge(),
        }
    }
}

impl Port for Operand {
    fn edge(&self) -> Option<EdgeIndex> {
        match self {
            Self::Number(_) => None,
            Self::Image(port) => port.edge(),
        }
    }
}

/// The shape of a scalar output.
pub const fn scalar(components: u8) -> EdgeType {
    EdgeType::Scalar(ScalarType { components })
}
