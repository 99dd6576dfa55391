//! The plan: steps over physical slots. Plain data, made by [`crate::plan`], printed by `pipe plan`, run by the
//! executor. The same graph, sizes and limits give the same plan, byte for byte, on every machine.
//!
//! **Invariants** that holding a `Plan` proves: no slot holds two live resources; every step reads what an
//! earlier step wrote; a loop leaves its states in the slots that later steps read.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use pipe_graph::pass::Limits;
use pipe_graph::types::{ImageType, VolumeType};
use serde::Serialize;

use crate::PlanError;
use crate::compose::put_together;

/// Index of a slot in [`Plan::slots`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct SlotId(pub u32);

/// Index of a kernel in [`Plan::kernels`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct KernelId(pub u32);

/// Physical storage of one kind; resources of equal storage may take turns in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Storage {
    /// A 2D texture.
    Image(ImageType),
    /// A 3D texture.
    Volume(VolumeType),
    /// A storage buffer; a multiple of 4 bytes, at least 16.
    Buffer {
        /// Size in bytes.
        bytes: u64,
    },
}

impl Storage {
    /// Bytes that it takes.
    pub const fn bytes(&self) -> u64 {
        match self {
            Self::Image(t) => t.size[0] as u64 * t.size[1] as u64 * t.channels as u64 * t.precision.bytes(),
            Self::Volume(t) => t.size[0] as u64 * t.size[1] as u64 * t.size[2] as u64 * t.channels as u64 * t.precision.bytes(),
            Self::Buffer { bytes } => *bytes,
        }
    }
}

/// One slot.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    /// What it is made of.
    pub storage: Storage,
    /// Whether the host fills it (externals, literals): CPU adapters map it instead of copying.
    pub uploaded: bool,
    /// Whether the host reads it at the end.
    pub fetched: bool,
}

/// What a binding of a kernel is. Binding numbers are positions in [`Kernel::bindings`], all in group 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Binding {
    /// The kernel's uniform block.
    Uniform {
        /// Its size in bytes, a multiple of 16.
        bytes: u32,
    },
    /// `texture_2d<f32>`, read by `textureLoad` only.
    SampledImage,
    /// `texture_3d<f32>`, likewise.
    SampledVolume,
    /// `texture_storage_2d<FORMAT, write>`
    StorageImage(ImageType),
    /// `texture_storage_3d<FORMAT, write>`
    StorageVolume(VolumeType),
    /// `var<storage, read>`
    ReadBuffer,
    /// `var<storage, read_write>`
    WriteBuffer,
    /// A word that a user's shader sets when its loops do not come to an end: `var<storage, read_write> overrun:
    /// atomic<u32>`. No slot: the executor has it, and looks at it when the work is done.
    Overrun,
}

impl Binding {
    /// Whether a slot is bound to it.
    pub const fn takes_slot(self) -> bool {
        !matches!(self, Self::Uniform { .. } | Self::Overrun)
    }
}

/// How a kernel is launched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Launch {
    /// A compute shader; its entry point is `main`.
    Compute,
    /// Points drawn with additive blending (source One, destination One) into one cleared colour target;
    /// entry points `vertex_main` and `fragment_main`.
    Points(ImageType),
}

/// Where the WGSL text of a kernel comes from.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Source {
    /// Here it is.
    Text(Arc<str>),
    /// Modules by name, the main one last, to be put together where the kernel is compiled: most kernels of a frame were
    /// compiled for the one before.
    Modules(Arc<[(String, String)]>),
}

impl Kernel {
    /// The whole WGSL text: the same bytes for equal kernels.
    pub fn wgsl(&self) -> Result<Cow<'_, str>, PlanError> {
        match &self.source {
            Source::Text(text) => Ok(Cow::Borrowed(text)),
            Source::Modules(modules) => {
                put_together(modules).map(Cow::Owned).map_err(|message| PlanError::Shader { label: self.label.clone(), message })
            }
        }
    }
}

/// A shader module with its interface. Equal kernels occur once in a plan.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Kernel {
    /// For messages: the names of the shader files in it.
    pub label: String,
    /// What it is made of.
    pub source: Source,
    /// What it binds in group 0.
    pub bindings: Vec<Binding>,
    /// Compute or draw.
    pub launch: Launch,
    /// Whether it may be built without bounds checks and loop bounding: no user shader is in it.
    pub trusted: bool,
}

/// One launch.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Name of the pass (fused: names joined by `+`).
    pub name: String,
    /// Names of the nodes that it does the work of.
    pub nodes: Vec<String>,
    /// What is launched.
    pub kernel: KernelId,
    /// Slots for the kernel's bindings, the uniform block left out.
    pub slots: Vec<SlotId>,
    /// Offset of the uniform block in [`Plan::uniforms`], a multiple of 256.
    pub uniform_offset: u32,
    /// Workgroups; for points `[points, 1, 1]`.
    pub groups: [u32; 3],
    /// Slots that are filled with zeros before it.
    pub clears: Vec<SlotId>,
    /// Bytes that it reads and writes at least once.
    pub bytes: u64,
    /// Names of the resources it reads and writes, for `pipe plan`.
    pub reads: Vec<String>,
    /// As above.
    pub writes: Vec<String>,
}

/// A loop. Iteration 0 runs `first`, which reads the initial states; then `odd` and `even` alternate
/// (iteration 1 is odd), so that states ping-pong without a copy.
#[derive(Debug, Clone, PartialEq)]
pub struct Repeat {
    /// For messages.
    pub name: String,
    /// The node it came from.
    pub node: String,
    /// Iteration 0.
    pub first: Vec<Step>,
    /// Iterations 1, 3, 5, …
    pub odd: Vec<Step>,
    /// Iterations 2, 4, 6, …
    pub even: Vec<Step>,
    /// How often.
    pub count: Times,
    /// For a loop of unknown length: pairs (written by `first` and `even`, written by `odd`). Later steps read the
    /// second of each pair, so when the last iteration was no odd one the first is copied there. Empty when the
    /// length is known: then later steps read the slot that the last iteration wrote.
    pub settle: Vec<(SlotId, SlotId)>,
}

/// When a loop ends.
#[derive(Debug, Clone, PartialEq)]
pub enum Times {
    /// After so many iterations, at least 1.
    Fixed(u32),
    /// When the value is below the limit.
    Until {
        /// Slot of the scalar as (even iterations and the first, odd iterations) write it.
        value: [SlotId; 2],
        /// The bound; NaN never passes.
        limit: f32,
        /// Iterations between checks.
        every: u32,
        /// The most iterations.
        max: u32,
    },
}

impl Times {
    /// Iterations that are sure to run: all of a fixed number, those before the first check otherwise.
    pub fn least(&self) -> u32 {
        match *self {
            Self::Fixed(n) => n,
            Self::Until { every, max, .. } => every.min(max),
        }
    }
}

/// A rectangle of pixels.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Rect {
    /// Columns.
    pub x: Range<u32>,
    /// Rows.
    pub y: Range<u32>,
}

impl Rect {
    /// Width and height.
    pub const fn size(&self) -> [u32; 2] {
        [self.x.end - self.x.start, self.y.end - self.y.start]
    }

    /// Number of pixels.
    pub const fn area(&self) -> u64 {
        let [w, h] = self.size();
        w as u64 * h as u64
    }

    /// The smallest that holds both.
    pub(crate) fn hull(&self, other: &Self) -> Self {
        let both = |a: &Range<u32>, b: &Range<u32>| a.start.min(b.start)..a.end.max(b.end);
        Self { x: both(&self.x, &other.x), y: both(&self.y, &other.y) }
    }
}

/// Images that are made tile by tile, since they do not fit whole. The same steps run for every tile, row by row of tiles,
/// in the same slots; what the tiles leave in tables and in whole images lies in slots of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Tiling {
    /// For messages: the names of what it makes.
    pub name: String,
    /// Width and height of the images.
    pub size: [u32; 2],
    /// Width and height of a tile that no edge cuts.
    pub step: [u32; 2],
    /// Pixels that are computed for each that is wanted: above 1 where tiles overlap.
    pub work: f32,
    /// Slots that are filled with zeros before the first tile.
    pub clears: Vec<SlotId>,
    /// What runs for a tile.
    pub body: Vec<Step>,
    /// The tiles.
    pub tiles: Vec<Tile>,
}

impl Tiling {
    /// How many tiles there are across and down.
    pub const fn layout(&self) -> [u32; 2] {
        [self.size[0].div_ceil(self.step[0]), self.size[1].div_ceil(self.step[1])]
    }
}

/// What differs from tile to tile.
#[derive(Debug, Clone, PartialEq)]
pub struct Tile {
    /// Pixels that the host brings before.
    pub uploads: Vec<Crossing>,
    /// Words of the uniform buffer, by their byte offset.
    pub uniforms: Vec<(u32, i32)>,
    /// Workgroups of the launches of the body, in their order (those of a loop's three parts one after the other).
    pub groups: Vec<[u32; 3]>,
    /// Pixels that the host takes afterwards.
    pub fetches: Vec<Crossing>,
}

/// A rectangle of a picture between host and device. In its slot the pixels lie row after row, without padding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Crossing {
    /// The external, or the fetch.
    pub name: String,
    /// Which plane of the picture, where each channel has one; 0 otherwise.
    pub plane: u32,
    /// Bytes of one pixel of the plane.
    pub pixel: u32,
    /// Width and height of the picture.
    pub size: [u32; 2],
    /// Which pixels.
    pub rect: Rect,
    /// Where they lie on the device.
    pub slot: SlotId,
}

impl Crossing {
    /// Bytes of the rectangle.
    pub const fn bytes(&self) -> u64 {
        self.rect.area() * self.pixel as u64
    }

    /// Where the rectangle's rows lie in memory that holds, of each plane, the rows from `held.start` to `held.end`.
    pub fn ranges(&self, held: &Range<u32>) -> Vec<Range<u64>> {
        let (width, pixel) = (u64::from(self.size[0]), u64::from(self.pixel));
        let plane = u64::from(self.plane) * width * u64::from(held.end - held.start) * pixel;
        let [w, h] = self.rect.size().map(u64::from);
        let first = plane + (u64::from(self.rect.y.start - held.start) * width + u64::from(self.rect.x.start)) * pixel;
        if w == width {
            return vec![first..first + w * h * pixel];
        }
        (0..h).map(|y| first + y * width * pixel..first + (y * width + w) * pixel).collect()
    }
}

/// One thing that happens.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// A launch.
    Run(Run),
    /// A loop.
    Repeat(Repeat),
    /// Tiles. Never inside another step.
    Tiles(Tiling),
}

/// Bytes of an external that the host writes into a slot before the first step.
#[derive(Debug, Clone, PartialEq)]
pub struct Upload {
    /// Name of the external.
    pub name: String,
    /// Byte ranges of the external, concatenated in the slot.
    pub ranges: Vec<Range<u64>>,
    /// Where to.
    pub slot: SlotId,
}

/// What comes back after the last step.
#[derive(Debug, Clone, PartialEq)]
pub struct Fetched {
    /// Name that the caller asks by.
    pub name: String,
    /// Slots with the byte range of the whole that each holds from its offset 0.
    pub parts: Vec<(SlotId, Range<u64>)>,
}

/// A value kept between frames. The executor keeps copies of the last `delay` values of `keep` under this name.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// Name across frames.
    pub name: String,
    /// How many frames the value waits.
    pub delay: u32,
    /// Slot that holds the new value after the last step.
    pub keep: SlotId,
    /// Slot that is filled with the value of `delay` frames ago before the first step, once there is one.
    pub recall: Option<SlotId>,
}

/// Everything that the executor needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Name of the graph.
    pub name: String,
    /// The device it was made for.
    pub limits: Limits,
    /// Physical storage.
    pub slots: Vec<Slot>,
    /// Distinct kernels.
    pub kernels: Vec<Kernel>,
    /// Content of the uniform buffer.
    pub uniforms: Vec<u8>,
    /// Tables known when planning.
    pub literals: Vec<(SlotId, Arc<[u8]>)>,
    /// What the host supplies.
    pub uploads: Vec<Upload>,
    /// What happens.
    pub steps: Vec<Step>,
    /// What comes back.
    pub fetches: Vec<Fetched>,
    /// What is kept for later frames.
    pub histories: Vec<History>,
    /// Most bytes alive at once: what the slots take together.
    pub peak_bytes: u64,
    /// What it would take without sharing.
    pub naive_bytes: u64,
    /// Bytes that all steps read and write; a loop that ends by a value counts up to its first check.
    pub bytes_moved: u64,
}
