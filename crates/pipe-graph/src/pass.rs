//! The pass graph: what the GPU must do, before anyone decided when or where.
//!
//! Plain data. A pass names the resources it reads (and how far around each pixel), those it writes, its
//! parameters and its shader; nothing here knows bindings, textures or buffers, and nothing knows which node
//! a pass came from beyond a label for messages. The planner looks only at these declarations, so that a new
//! node never needs a new case in the planner.
//!
//! **Invariant**: every resource has at most one writer. Iteration is explicit ([`Loop`]): what one iteration
//! hands to the next is a *state*, and the planner turns states into ping-pong pairs.

use std::ops::Range;
use std::sync::Arc;

use indexmap::IndexMap;

use crate::types::{EdgeType, Element, ImageType, Precision, VolumeType};

/// Index of a resource in [`PassGraph::resources`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ResourceId(pub u32);

impl ResourceId {
    /// The position in the arena.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Index of a node label in [`PassGraph::nodes`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeLabel(pub u32);

/// The shape of a resource: all that matters for storage, so two resources of equal shape may share a slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Shape {
    /// A 2D image.
    Image(ImageType),
    /// A 3D image.
    Volume(VolumeType),
    /// `len` entries of 4 bytes.
    Table {
        /// Number of entries.
        len: u32,
        /// What an entry is.
        element: Element,
    },
    /// Four floats.
    Scalar,
    /// Raw 32-bit words: voxels as they lie in a file, on their way in or out. Seen by shaders as a table of u32.
    Words {
        /// Number of 32-bit words.
        len: u32,
    },
    /// Pixels as they lie in a file, on their way in or out: rows without padding, the last word filled up. Seen by
    /// shaders as a table of u32.
    Pixels {
        /// Width and height.
        size: [u32; 2],
        /// Bytes of one pixel; of one of its samples where each channel lies in a plane of its own.
        pixel: u32,
    },
}

impl Shape {
    /// Bytes of storage, without any padding a device may add.
    pub const fn bytes(&self) -> u64 {
        match self {
            Self::Image(t) => t.size[0] as u64 * t.size[1] as u64 * t.channels as u64 * t.precision.bytes(),
            Self::Volume(t) => t.size[0] as u64 * t.size[1] as u64 * t.size[2] as u64 * t.channels as u64 * t.precision.bytes(),
            Self::Table { len, .. } | Self::Words { len } => *len as u64 * 4,
            Self::Pixels { size, pixel } => (size[0] as u64 * size[1] as u64 * *pixel as u64).next_multiple_of(4),
            Self::Scalar => 16,
        }
    }

    /// Entries of a table or of what is seen as one; 1 of anything else. No buffer has more than an `i32` counts.
    pub const fn entries(&self) -> u32 {
        match self {
            Self::Table { len, .. } | Self::Words { len } => *len,
            Self::Pixels { .. } if self.bytes() / 4 > i32::MAX as u64 => i32::MAX as u32,
            Self::Pixels { .. } => (self.bytes() / 4) as u32,
            _ => 1,
        }
    }

    /// Width and height of an image, or of pixels of a file.
    pub const fn plane(&self) -> Option<[u32; 2]> {
        match self {
            Self::Image(t) => Some(t.size),
            Self::Pixels { size, .. } => Some(*size),
            _ => None,
        }
    }

    /// A 32-bit float image.
    pub const fn image(size: [u32; 2], channels: u8) -> Self {
        Self::Image(ImageType { size, channels, precision: Precision::F32 })
    }

    /// A table of floats.
    pub const fn floats(len: u32) -> Self {
        Self::Table { len, element: Element::F32 }
    }

    /// A table of unsigned integers.
    pub const fn uints(len: u32) -> Self {
        Self::Table { len, element: Element::U32 }
    }

    /// The shape that carries an edge of this type; a mesh is carried by several resources and has none.
    pub const fn of_edge(edge: &EdgeType) -> Option<Self> {
        match edge {
            EdgeType::Image(t) => Some(Self::Image(*t)),
            EdgeType::Volume(t) => Some(Self::Volume(*t)),
            EdgeType::Table(t) => Some(Self::Table { len: t.len, element: t.element }),
            EdgeType::Scalar(_) => Some(Self::Scalar),
            EdgeType::Mesh(_) => None,
        }
    }
}

/// Where the content of a resource comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum Origin {
    /// Some pass writes it.
    Pass,
    /// The caller supplies it at each run: these byte ranges of the external of this name, one after another.
    External {
        /// A graph input or a file source.
        name: String,
        /// Byte ranges of its pixels, in the order in which they lie in the resource.
        ranges: Vec<Range<u64>>,
    },
    /// These little-endian bytes, known when planning.
    Literal(Arc<[u8]>),
    /// It is the state of a loop as an iteration sees it, or as the loop leaves it.
    State,
    /// Kept by the executor from an earlier frame under this name: the delayed value of a `Feedback`.
    History {
        /// Names the pair of slots across runs.
        name: String,
        /// Frames between writing and reading, at least 1.
        delay: u32,
    },
}

/// Something that passes read and write.
#[derive(Debug, Clone, PartialEq)]
pub struct Resource {
    /// Private name for `plan` and for messages, such as `blurred` or `blurred.rows`.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Where its content comes from.
    pub origin: Origin,
}

/// How far around an output pixel a pass looks in an input. It decides fusion and tiling, so it must be true;
/// a test perturbs pixels outside the reach of every pass and expects the output not to change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reach {
    /// The same pixel only. The input has the output's size.
    Point,
    /// At most this many pixels to either side along x and y, in an input of the output's size.
    Around(u32, u32),
    /// At pixels elsewhere in an input of any size: where along its x, and where along its y.
    Elsewhere([Stretch; 2]),
    /// Anywhere.
    Whole,
}

impl Reach {
    /// One pixel, so far away along x and y.
    pub fn shifted(by: [i32; 2]) -> Self {
        Self::Elsewhere([0, 1].map(|axis| Stretch::shift(axis, by[axis])))
    }
}

/// Where output pixels look along one axis of an input: pixel i at `count` pixels from ⌊i·num/den⌋ + `first` on. What of
/// them is outside the input follows its border policy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Stretch {
    /// The axis of the output along which i counts: 0 is x, 1 is y.
    pub along: usize,
    /// Input pixels for `den` output pixels; negative where they are read backwards.
    pub num: i32,
    /// Not 0.
    pub den: u32,
    /// Offset of the first pixel.
    pub first: i32,
    /// Not 0.
    pub count: u32,
}

impl Stretch {
    /// One pixel, so many further on.
    pub const fn shift(along: usize, by: i32) -> Self {
        Self { along, num: 1, den: 1, first: by, count: 1 }
    }

    /// One pixel, counted from the other end of an axis of so many.
    pub const fn mirrored(along: usize, size: u32) -> Self {
        Self { along, num: -1, den: 1, first: size as i32 - 1, count: 1 }
    }

    /// The first of the pixels at which pixel `i` looks.
    pub fn first_of(&self, i: u32) -> i64 {
        (i64::from(i) * i64::from(self.num)).div_euclid(i64::from(self.den)) + i64::from(self.first)
    }
}

/// What an image port answers outside the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub enum Border {
    /// The nearest edge pixel.
    #[default]
    Clamp,
    /// Reflection, the edge pixel repeated (…2 1 0 | 0 1 2…).
    Mirror,
    /// Periodic continuation.
    Repeat,
    /// Transparent black.
    Black,
}

/// How `sample_NAME` reads between pixel centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub enum Filter {
    /// The pixel that holds the point.
    Nearest,
    /// Bilinear (trilinear in volumes), computed in 32-bit arithmetic.
    #[default]
    Linear,
}

/// An input port of a pass.
#[derive(Debug, Clone, PartialEq)]
pub struct Read {
    /// The name that the shader uses: `load_NAME`.
    pub port: String,
    /// What is read.
    pub resource: ResourceId,
    /// How far around.
    pub reach: Reach,
    /// Whether the whole pass loads each element at most once, as reductions do; so that what makes the elements may be
    /// computed in its place.
    pub once: bool,
    /// What lies outside.
    pub border: Border,
    /// How `sample_NAME` interpolates.
    pub filter: Filter,
}

/// How a pass writes an output port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Elements are written (`store_NAME`), none is read. All of them, unless the write is `in_place_of` another.
    Store,
    /// Tables of u32 only: `add_NAME`, `max_NAME`, `min_NAME` (atomic) and `load_NAME`, on zeros to begin with.
    Atomic,
    /// Tables and volumes kept in tables only: `load_NAME` and `store_NAME` on what `in_place_of` held
    /// (or on zeros).
    Update,
    /// As `Atomic`, on what `in_place_of` held (or on zeros).
    AtomicUpdate,
}

/// An output port of a pass.
#[derive(Debug, Clone, PartialEq)]
pub struct Write {
    /// The name that the shader uses: `store_NAME`.
    pub port: String,
    /// What is written.
    pub resource: ResourceId,
    /// How.
    pub access: Access,
    /// The earlier resource whose storage (and content) this write takes over; it dies here.
    pub in_place_of: Option<ResourceId>,
}

/// A parameter's value.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// `f32`
    F32(f32),
    /// `i32`
    I32(i32),
    /// `u32`
    U32(u32),
    /// `vec2f`
    Vec2([f32; 2]),
    /// `vec3f`
    Vec3([f32; 3]),
    /// `vec4f`
    Vec4([f32; 4]),
    /// `vec2i`
    Vec2I([i32; 2]),
    /// `vec3i`
    Vec3I([i32; 3]),
    /// `f32`, the first component of this scalar resource, read on the GPU.
    Driven(ResourceId),
}

/// WGSL text with the name it is known by in messages.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Shader {
    /// Path below `shaders/` for built-in shaders (`filters/blur.wgsl`), the user's path otherwise.
    pub path: Arc<str>,
    /// The text, without any binding.
    pub source: Arc<str>,
    /// Built-in shaders run without bounds checks and loop bounding; a user's never do.
    pub trusted: bool,
}

impl Shader {
    /// A shader that is part of the program.
    pub fn builtin(path: &str, source: &str) -> Self {
        Self { path: path.into(), source: source.into(), trusted: true }
    }

    /// A shader that a user wrote.
    pub fn user(path: &str, source: &str) -> Self {
        Self { path: path.into(), source: source.into(), trusted: false }
    }
}

/// How a shader is called.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Entry {
    /// `fn apply(PORT: vec4f, …) -> vec4f`, one argument an image read in order, all of reach `Point`; tables and
    /// scalars may be read too, by `load_NAME`. May be fused.
    /// A pass without image reads is a source. `pixel()` tells where it is.
    Point,
    /// `fn at(xy: vec2i) -> vec4f` for an image (`vec3i` for a volume, `i32` for a table) output.
    At,
    /// `fn each(xy: vec2i)`: called for every element of the first output, stores by itself (several outputs).
    Each,
    /// `@compute @workgroup_size(…) fn main(…)` with its own workgroups.
    Kernel,
    /// `fn begin()`, `fn take(xy: vec2i, v: vec4f)` for each pixel of its one image read in order, `fn end()`: a reduction
    /// over a [`Grid::Walk`]. Folds over the same image share one walk.
    Fold(Workspace),
    /// `fn vertex(index: u32) -> vec4f` (clip-space point; w = 0 drops it) and `fn fragment() -> vec4f`: one
    /// point a vertex, blended additively into the first output, an image.
    Points,
}

/// What a fold needs of workgroup memory, of which all folds of a kernel together have 16 KiB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Workspace {
    /// Bytes that its shader declares by itself.
    pub own: u32,
    /// `vec4f`s of the scratch that the folds of a kernel use one after the other.
    pub scratch: u32,
}

/// How workgroups walk an image: each takes a tile, each lane the pixels of the tile at a stride of the group, row after row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Walk {
    /// Threads of a workgroup along x and y.
    pub lanes: [u32; 2],
    /// Pixels of a tile along x and y, multiples of the lanes.
    pub tile: [u32; 2],
}

impl Walk {
    /// How many workgroups walk an image of this size.
    pub fn groups(&self, size: [u32; 2]) -> [u32; 2] {
        std::array::from_fn(|i| size[i].div_ceil(self.tile[i]))
    }

    /// Threads of a workgroup.
    pub const fn lane_count(&self) -> u32 {
        self.lanes[0] * self.lanes[1]
    }
}

/// How many invocations or workgroups run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grid {
    /// One call for each element of the first output.
    Cover,
    /// One call for each element of a grid of this size (`Each`: xyz with y, z = 1 when unused), or this many
    /// points for `Points`.
    Elements([u32; 3]),
    /// This many workgroups of a `Kernel`.
    Groups([u32; 3]),
    /// One call of `Each`, or one workgroup of a `Kernel`, for each block of so many pixels: block (i, j) holds those from
    /// (i·w, j·h) on. The pixels are those of the first image that is written, or else of the image that is read once;
    /// a block writes no others, and reads no others of what it reads once. A `Kernel` asks `block(group)` which is its.
    Blocks([u32; 2]),
    /// One call for each so many pixels of the first output, pixels of a file.
    Pixels(u32),
    /// Every pixel of the image of a `Fold`, each once.
    Walk(Walk),
}

/// A constant of the shader module: part of the kernel's text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Constant {
    /// `const NAME: i32`
    I32(i32),
    /// `const NAME: u32`
    U32(u32),
    /// `const NAME: f32`
    F32(f32),
    /// `const NAME: bool`
    Bool(bool),
}

/// What is known of the values that a pass makes; it decides how they are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Values {
    /// Anything.
    #[default]
    Any,
    /// Numbers that half floats hold exactly.
    Halves,
    /// Numbers that it read in its images, and 0 and 1.
    Read,
}

/// One shader call over a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Pass {
    /// Name for `plan`, `bench` and messages: the node's name, with a suffix when it has several passes.
    pub name: String,
    /// The node it came from.
    pub node: NodeLabel,
    /// The WGSL.
    pub shader: Shader,
    /// How it is called.
    pub entry: Entry,
    /// Inputs, in the order of `apply`'s arguments.
    pub reads: Vec<Read>,
    /// Outputs; the first one gives the grid when it is [`Grid::Cover`].
    pub writes: Vec<Write>,
    /// `params.NAME` in the shader.
    pub params: IndexMap<String, Value>,
    /// Constants of the module.
    pub constants: IndexMap<String, Constant>,
    /// How many.
    pub grid: Grid,
    /// What is known of its values.
    pub values: Values,
}

impl Pass {
    /// Every resource that it reads: ports, driving scalars, and what it updates in place.
    pub fn sources(&self) -> impl Iterator<Item = ResourceId> + '_ {
        let driven = self.params.values().filter_map(|v| match v {
            Value::Driven(r) => Some(*r),
            _ => None,
        });
        self.reads.iter().map(|r| r.resource).chain(driven).chain(self.writes.iter().filter_map(|w| w.in_place_of))
    }
}

/// What one iteration hands to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Its value before the first iteration.
    pub init: ResourceId,
    /// Its value as the body of an iteration reads it ([`Origin::State`]).
    pub carried: ResourceId,
    /// Its value as the body leaves it; written in the body, or another state's `carried`, or from outside.
    pub next: ResourceId,
    /// Its value after the last iteration ([`Origin::State`]).
    pub result: ResourceId,
}

/// When a loop ends.
#[derive(Debug, Clone, PartialEq)]
pub enum Count {
    /// After exactly this many iterations.
    Fixed(u32),
    /// After the first check that finds `value` (its first component) below `limit`, checked every `every`
    /// iterations; after `max` at the latest.
    Until {
        /// A scalar written in the body.
        value: ResourceId,
        /// The bound.
        limit: f32,
        /// Iterations between checks, at least 1.
        every: u32,
        /// The most iterations.
        max: u32,
    },
}

/// A body that runs many times.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// Name for `plan` and messages.
    pub name: String,
    /// The node it came from.
    pub node: NodeLabel,
    /// What an iteration hands on.
    pub states: Vec<State>,
    /// The body, in dependency order.
    pub body: Vec<Item>,
    /// How often.
    pub count: Count,
}

/// A pass or a loop.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// One pass.
    Pass(Pass),
    /// A loop.
    Loop(Loop),
}

/// What must come back to the host after a run: tables, scalars and words, never images.
#[derive(Debug, Clone, PartialEq)]
pub struct Fetch {
    /// The name that the caller asks by: a graph output, a readback's node name.
    pub name: String,
    /// What is fetched, and which bytes of the whole it is.
    pub parts: Vec<(ResourceId, Range<u64>)>,
}

/// A value that is kept from frame to frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    /// Name of its history.
    pub name: String,
    /// The resource whose value is kept.
    pub resource: ResourceId,
    /// For how many frames, at least 1; known also while there are too few frames for anyone to read it.
    pub delay: u32,
}

/// What the GPU must do.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PassGraph {
    /// The arena of resources.
    pub resources: Vec<Resource>,
    /// Names of the nodes that passes came from.
    pub nodes: Vec<String>,
    /// Passes and loops, each after everything it reads.
    pub items: Vec<Item>,
    /// What comes back.
    pub fetches: Vec<Fetch>,
    /// What this frame keeps for later ones.
    pub kept: Vec<Kept>,
}

impl PassGraph {
    /// The resource of this id.
    pub fn resource(&self, id: ResourceId) -> &Resource {
        &self.resources[id.index()]
    }

    /// Adds a resource.
    pub fn add(&mut self, resource: Resource) -> ResourceId {
        self.resources.push(resource);
        ResourceId(self.resources.len() as u32 - 1)
    }
}

/// Which of the two kinds of machine a kernel is written for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Profile {
    /// Thousands of threads: square workgroups, workgroup memory, subgroups.
    #[default]
    Gpu,
    /// A few cores: long rows, no barriers, serial scans.
    Cpu,
}

/// What the planner needs to know of a device; nothing else about it may change a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Limits {
    /// Kind of machine.
    pub profile: Profile,
    /// Largest width or height of an image.
    pub max_image: u32,
    /// Largest extent of a volume.
    pub max_volume: u32,
    /// Largest buffer that a shader can bind, in bytes.
    pub max_binding_bytes: u64,
    /// Most bytes of anything in one piece.
    pub max_piece: u64,
    /// Most textures that a kernel may read.
    pub max_sampled_images: u32,
    /// Most textures that a kernel may write.
    pub max_storage_images: u32,
    /// Most buffers that a kernel may bind.
    pub max_storage_buffers: u32,
    /// Most workgroups along one axis of a dispatch.
    pub max_groups: u32,
    /// Whether 1- and 2-channel half images can be written by kernels (`r16float`, `rg16float` storage).
    pub half_storage: bool,
    /// Bytes that may be alive at once, staging included; `None` when nobody knows.
    pub budget: Option<u64>,
    /// Whether images are to be made tile by tile, since they do not fit whole: passes of bounded reach are wanted.
    #[serde(skip)]
    pub tiled: bool,
}

impl Default for Limits {
    /// What `plan` assumes when no device is asked.
    fn default() -> Self {
        Self {
            profile: Profile::Gpu,
            max_image: 16384,
            max_volume: 2048,
            max_binding_bytes: 1 << 31,
            max_piece: u64::MAX,
            max_sampled_images: 16,
            max_storage_images: 8,
            max_storage_buffers: 8,
            max_groups: 65535,
            half_storage: true,
            budget: None,
            tiled: false,
        }
    }
}
