//! How a node says what the GPU must do: a pass reads as the list of its ports.
//!
//! ```text
//! let rows = cx.intermediate("rows", cx.shape(&self.image));
//! cx.pass("rows", shader!("filters/blur")).entry(Entry::At)
//!     .read("image", cx.image(&self.image), Reach::Around(radius, 0))
//!     .write("out", rows).param("sigma", sigma).constant("RADIUS", radius as i32).add();
//! ```

use std::sync::Arc;

use indexmap::IndexMap;

use crate::field::{Accepts, Driven, EdgeIndex, Image, In, Mesh};
use crate::node::{Mistake, as_image};
use crate::pass::{
    Access, Border, Constant, Count, Entry, Filter, Grid, Item, Kept, Limits, Loop, NodeLabel, Origin, Pass, PassGraph, Reach, Read,
    Resource, ResourceId, Shader, Shape, State, Value, Values, Write,
};
use crate::types::{EdgeType, ImageType};

/// The resources that carry one edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carried {
    /// An image, volume, table or scalar.
    One(ResourceId),
    /// A mesh.
    Mesh(MeshParts),
}

/// The resources of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshParts {
    /// Table of f32: x, y, z, nx, ny, nz for each vertex.
    pub vertices: ResourceId,
    /// Table of u32: three vertex indices for each triangle.
    pub triangles: ResourceId,
    /// Table of two u32: the number of vertices and of triangles.
    pub counts: ResourceId,
}

/// Everything that a node needs to declare its passes.
#[derive(Debug)]
pub struct Lowering<'a> {
    pub(crate) graph: &'a mut PassGraph,
    pub(crate) label: NodeLabel,
    pub(crate) name: &'a str,
    pub(crate) inputs: &'a [Carried],
    pub(crate) types: &'a [EdgeType],
    pub(crate) outputs: &'a [crate::node::Output],
    pub(crate) emitted: IndexMap<String, Carried>,
    pub(crate) file: Option<ResourceId>,
    pub(crate) items: Vec<Item>,
    pub(crate) limits: &'a Limits,
    pub(crate) border: Border,
    pub(crate) filter: Filter,
    pub(crate) seed: u64,
    pub(crate) frames_before: Option<u32>,
}

/// What the phase `lower` knows when it asks a node for its passes.
#[derive(Debug)]
pub struct Site<'a> {
    /// The node's private name.
    pub name: &'a str,
    /// Its label in the pass graph.
    pub label: NodeLabel,
    /// What arrives at its edges.
    pub inputs: &'a [Carried],
    /// The types that arrive.
    pub types: &'a [EdgeType],
    /// Its output ports.
    pub outputs: &'a [crate::node::Output],
    /// The file that it asked for.
    pub file: Option<ResourceId>,
    /// The device.
    pub limits: &'a Limits,
    /// `options.border`
    pub border: Border,
    /// `options.filter`
    pub filter: Filter,
    /// `--seed`, 0 unless given.
    pub seed: u64,
    /// How many frames ran before this one; `None` inside an iteration, where there are no frames.
    pub frames_before: Option<u32>,
}

impl<'a> Lowering<'a> {
    /// Starts the lowering of one node.
    pub fn new(graph: &'a mut PassGraph, site: &Site<'a>) -> Self {
        Self {
            graph,
            label: site.label,
            name: site.name,
            inputs: site.inputs,
            types: site.types,
            outputs: site.outputs,
            emitted: IndexMap::new(),
            file: site.file,
            items: Vec::new(),
            limits: site.limits,
            border: site.border,
            filter: site.filter,
            seed: site.seed,
            frames_before: site.frames_before,
        }
    }

    /// The passes that were declared, and what leaves by each port.
    pub fn finish(self) -> (Vec<Item>, IndexMap<String, Carried>) {
        (self.items, self.emitted)
    }

    /// The node's private name.
    pub fn name(&self) -> &str {
        self.name
    }

    /// The device that the plan is for.
    pub fn limits(&self) -> &Limits {
        self.limits
    }

    /// The user's `--seed`, to be mixed with the node's own.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// How many frames ran before this one; `None` inside an iteration, where there are no frames.
    pub fn frames_before(&self) -> Option<u32> {
        self.frames_before
    }

    /// What [`Lowering::keep`] kept under this suffix in the frame before this one.
    pub fn recall(&mut self, suffix: &str, shape: Shape) -> ResourceId {
        let name = format!("{}.{suffix}", self.name);
        let origin = Origin::History { name: name.clone(), delay: 1 };
        self.graph.add(Resource { name, shape, origin })
    }

    /// Keeps a resource for the next frame.
    pub fn keep(&mut self, suffix: &str, id: ResourceId) {
        self.graph.kept.push(Kept { name: format!("{}.{suffix}", self.name), resource: id, delay: 1 });
    }

    /// The border policy of this node.
    pub fn border(&self) -> Border {
        self.border
    }

    /// `options.filter` of this node, for shaders that interpolate by themselves.
    pub fn filter(&self) -> Filter {
        self.filter
    }

    /// The type that arrives at an edge.
    pub fn ty(&self, edge: EdgeIndex) -> EdgeType {
        self.types[edge.0 as usize]
    }

    /// The type that arrives at an image port.
    pub fn image_type(&self, port: &In<Image>) -> ImageType {
        as_image(self.ty(port.edge))
    }

    /// What arrives at a bound port other than a mesh.
    pub fn input<T: Accepts>(&self, port: &In<T>) -> ResourceId {
        match self.inputs[port.edge.0 as usize] {
            Carried::One(id) => id,
            Carried::Mesh(_) => unreachable!("the resolver bound a mesh to a {} port", T::TOKEN),
        }
    }

    /// What arrives at any bound port.
    pub fn carried<T: Accepts>(&self, port: &In<T>) -> Carried {
        self.inputs[port.edge.0 as usize]
    }

    /// The mesh at a port.
    pub fn mesh(&self, port: &In<Mesh>) -> MeshParts {
        match self.inputs[port.edge.0 as usize] {
            Carried::Mesh(parts) => parts,
            Carried::One(_) => unreachable!("the resolver bound no mesh to a mesh port"),
        }
    }

    /// The file that [`Node::file`](crate::node::Node::file) asked for.
    pub fn file(&self) -> ResourceId {
        self.file.expect("lower provides the file of every node that asks for one")
    }

    /// A parameter value from a number or a scalar edge.
    pub fn driven(&self, value: &Driven) -> Value {
        match value {
            Driven::Value(v) => Value::F32(*v),
            Driven::Scalar(port) => Value::Driven(self.input(port)),
        }
    }

    /// The shape of a resource.
    pub fn shape(&self, id: ResourceId) -> Shape {
        self.graph.resource(id).shape
    }

    /// The type of an image resource.
    pub fn image_of(&self, id: ResourceId) -> ImageType {
        match self.shape(id) {
            Shape::Image(t) => t,
            other => unreachable!("not an image: {other:?}"),
        }
    }

    /// The type of one of the node's output ports.
    pub fn output_type(&self, port: &str) -> EdgeType {
        self.outputs.iter().find(|o| o.name == port).expect("a node lowers only the ports that it declared").ty
    }

    /// The resource that leaves by a port, made on first use.
    pub fn output(&mut self, port: &str) -> ResourceId {
        match self.emitted.get(port) {
            Some(Carried::One(id)) => *id,
            Some(Carried::Mesh(_)) => unreachable!("a mesh port is emitted whole"),
            None => {
                let shape = Shape::of_edge(&self.output_type(port)).expect("a mesh port is emitted whole");
                let first = self.outputs.first().is_some_and(|o| o.name == port);
                let name = if first { self.name.to_owned() } else { format!("{}.{port}", self.name) };
                let id = self.graph.add(Resource { name, shape, origin: Origin::Pass });
                self.emitted.insert(port.to_owned(), Carried::One(id));
                id
            }
        }
    }

    /// Lets an existing resource leave by a port: nothing is copied.
    pub fn emit(&mut self, port: &str, id: ResourceId) {
        self.emitted.insert(port.to_owned(), Carried::One(id));
    }

    /// Lets an input leave by a port as it is, unless another type leaves there, such as half precision. For parameters that
    /// leave every value as it is, NaN and infinity too: then no pass is needed. Answers whether it left.
    pub fn pass_on(&mut self, port: &str, id: ResourceId) -> bool {
        let same = Shape::of_edge(&self.output_type(port)) == Some(self.shape(id));
        if same {
            self.emit(port, id);
        }
        same
    }

    /// Lets a mesh leave by a port.
    pub fn emit_mesh(&mut self, port: &str, parts: MeshParts) {
        self.emitted.insert(port.to_owned(), Carried::Mesh(parts));
    }

    /// A resource between two passes of this node.
    pub fn intermediate(&mut self, name: &str, shape: Shape) -> ResourceId {
        let name = format!("{}.{name}", self.name);
        self.graph.add(Resource { name, shape, origin: Origin::Pass })
    }

    /// A table of floats known now.
    pub fn floats(&mut self, name: &str, values: &[f32]) -> ResourceId {
        let bytes: Arc<[u8]> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let name = format!("{}.{name}", self.name);
        self.graph.add(Resource { name, shape: Shape::floats(values.len() as u32), origin: Origin::Literal(bytes) })
    }

    /// A table of integers known now.
    pub fn uints(&mut self, name: &str, values: &[u32]) -> ResourceId {
        let bytes: Arc<[u8]> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let name = format!("{}.{name}", self.name);
        self.graph.add(Resource { name, shape: Shape::uints(values.len() as u32), origin: Origin::Literal(bytes) })
    }

    /// A scalar known now.
    pub fn scalar(&mut self, name: &str, value: [f32; 4]) -> ResourceId {
        let bytes: Arc<[u8]> = value.iter().flat_map(|v| v.to_le_bytes()).collect();
        let name = format!("{}.{name}", self.name);
        self.graph.add(Resource { name, shape: Shape::Scalar, origin: Origin::Literal(bytes) })
    }

    /// Starts a pass; `suffix` may be empty for a node of one pass.
    pub fn pass(&mut self, suffix: &str, shader: Shader) -> PassBuilder<'_, 'a> {
        let name = if suffix.is_empty() { self.name.to_owned() } else { format!("{}.{suffix}", self.name) };
        let pass = Pass {
            name,
            node: self.label,
            shader,
            entry: Entry::At,
            reads: Vec::new(),
            writes: Vec::new(),
            params: IndexMap::new(),
            constants: IndexMap::new(),
            grid: Grid::Cover,
            values: Values::Any,
        };
        PassBuilder { cx: self, pass }
    }

    /// Runs `body` `count` times. `init` are the states before the first iteration; `body` gets them as an
    /// iteration sees them and returns them as it leaves them, in the same order and of the same shapes.
    /// Answers the states after the last iteration.
    pub fn repeat(
        &mut self,
        suffix: &str,
        count: Count,
        init: &[ResourceId],
        body: impl FnOnce(&mut Self, &[ResourceId]) -> Result<Vec<ResourceId>, Mistake>,
    ) -> Result<Vec<ResourceId>, Mistake> {
        let name = if suffix.is_empty() { self.name.to_owned() } else { format!("{}.{suffix}", self.name) };
        let mut state = |id: ResourceId, what: &str| {
            let Resource { name, shape, .. } = self.graph.resource(id).clone();
            self.graph.add(Resource { name: format!("{name}.{what}"), shape, origin: Origin::State })
        };
        let carried: Vec<_> = init.iter().map(|id| state(*id, "before")).collect();
        let result: Vec<_> = init.iter().map(|id| state(*id, "after")).collect();
        let outside = std::mem::take(&mut self.items);
        let next = body(self, &carried)?;
        let inside = std::mem::replace(&mut self.items, outside);
        let states = init.iter().zip(&carried).zip(next.iter().zip(&result));
        let states = states.map(|((i, c), (n, r))| State { init: *i, carried: *c, next: *n, result: *r }).collect();
        self.items.push(Item::Loop(Loop { name, node: self.label, states, body: inside, count }));
        Ok(result)
    }
}

/// A pass under construction. [`PassBuilder::add`] ends it.
#[derive(Debug)]
#[must_use = "a pass exists once `add` is called"]
pub struct PassBuilder<'b, 'a> {
    cx: &'b mut Lowering<'a>,
    pass: Pass,
}

impl PassBuilder<'_, '_> {
    /// How the shader is called; `At` unless said.
    pub fn entry(mut self, entry: Entry) -> Self {
        self.pass.entry = entry;
        self
    }

    /// An input, with the node's border policy and filter.
    pub fn read(self, port: &str, resource: ResourceId, reach: Reach) -> Self {
        let (border, filter) = (self.cx.border, self.cx.filter);
        self.read_with(port, resource, reach, border, filter)
    }

    /// An input of which the whole pass loads each element at most once, in whatever order.
    pub fn read_once(mut self, port: &str, resource: ResourceId) -> Self {
        let (border, filter) = (self.cx.border, self.cx.filter);
        self.pass.reads.push(Read { port: port.to_owned(), resource, reach: Reach::Whole, once: true, border, filter });
        self
    }

    /// An input whose border policy and filter belong to the node's meaning.
    pub fn read_with(mut self, port: &str, resource: ResourceId, reach: Reach, border: Border, filter: Filter) -> Self {
        self.pass.reads.push(Read { port: port.to_owned(), resource, reach, once: reach == Reach::Point, border, filter });
        self
    }

    /// An output that is written whole.
    pub fn write(self, port: &str, resource: ResourceId) -> Self {
        self.write_as(port, resource, Access::Store, None)
    }

    /// An output with another access, possibly in the storage of an earlier resource.
    pub fn write_as(mut self, port: &str, resource: ResourceId, access: Access, in_place_of: Option<ResourceId>) -> Self {
        self.pass.writes.push(Write { port: port.to_owned(), resource, access, in_place_of });
        self
    }

    /// `params.NAME`
    pub fn param(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.pass.params.insert(name.to_owned(), value.into());
        self
    }

    /// `params.NAME` from a number or a scalar edge.
    pub fn driven(mut self, name: &str, value: &Driven) -> Self {
        let value = self.cx.driven(value);
        self.pass.params.insert(name.to_owned(), value);
        self
    }

    /// A constant of the module.
    pub fn constant(mut self, name: &str, value: impl Into<Constant>) -> Self {
        self.pass.constants.insert(name.to_owned(), value.into());
        self
    }

    /// How many; `Cover` unless said.
    pub fn grid(mut self, grid: Grid) -> Self {
        self.pass.grid = grid;
        self
    }

    /// What is known of its values; `Any` unless said.
    pub fn values(mut self, values: Values) -> Self {
        self.pass.values = values;
        self
    }

    /// Ends the pass.
    pub fn add(self) {
        self.cx.items.push(Item::Pass(self.pass));
    }
}

macro_rules! values {
    ($($from:ty => $to:ident::$variant:ident;)*) => {$(
        impl From<$from> for $to {
            fn from(v: $from) -> Self {
                Self::$variant(v)
            }
        }
    )*};
}

values! {
    f32 => Value::F32;
    i32 => Value::I32;
    u32 => Value::U32;
    [f32; 2] => Value::Vec2;
    [f32; 3] => Value::Vec3;
    [f32; 4] => Value::Vec4;
    [i32; 2] => Value::Vec2I;
    [i32; 3] => Value::Vec3I;
    i32 => Constant::I32;
    u32 => Constant::U32;
    f32 => Constant::F32;
    bool => Constant::Bool;
}
