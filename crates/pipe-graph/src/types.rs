//! What travels along an edge: the five edge types of the language and their shapes.
//!
//! Sizes are always known before anything runs: they come from the headers of the input files
//! (or from `--size`), and every node computes the shape of its outputs from the shapes of its inputs.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How many bits a stored component of an image or a volume has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize, JsonSchema)]
pub enum Precision {
    /// 32-bit float: what every computation is done in.
    #[default]
    F32,
    /// 16-bit float storage: 11 significant bits, magnitudes up to 65504.
    F16,
}

impl Precision {
    /// Bytes of one component.
    pub const fn bytes(self) -> u64 {
        match self {
            Self::F32 => 4,
            Self::F16 => 2,
        }
    }
}

/// A 2D image of linear light. Row 0 is the top row; pixel (x, y) has its centre at (x + 0.5, y + 0.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ImageType {
    /// Width and height in pixels, each at least 1.
    pub size: [u32; 2],
    /// 1 (grey), 2 (a pair of fields) or 4 (RGBA, alpha associated).
    pub channels: u8,
    /// Storage precision.
    pub precision: Precision,
}

impl ImageType {
    /// An image of 32-bit floats.
    pub const fn new(size: [u32; 2], channels: u8) -> Self {
        Self { size, channels, precision: Precision::F32 }
    }

    /// The same image with another number of channels.
    #[must_use]
    pub const fn with_channels(self, channels: u8) -> Self {
        Self { channels, ..self }
    }

    /// The same image at another size.
    #[must_use]
    pub const fn with_size(self, size: [u32; 2]) -> Self {
        Self { size, ..self }
    }
}

/// A 3D volume that fills the unit cube, x fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct VolumeType {
    /// Voxels along x, y and z, each at least 1.
    pub size: [u32; 3],
    /// 1 or 4.
    pub channels: u8,
    /// Storage precision.
    pub precision: Precision,
}

/// The element type of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
pub enum Element {
    /// 32-bit float.
    F32,
    /// Unsigned 32-bit integer: counts, exact.
    U32,
}

/// A 1D table: a histogram, a CDF, a curve, weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct TableType {
    /// Number of entries, at least 1.
    pub len: u32,
    /// What an entry is.
    pub element: Element,
}

/// One to four floats that stay on the GPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ScalarType {
    /// 1 to 4.
    pub components: u8,
}

/// A triangle mesh: room for this many vertices and triangles; the true counts are known on the GPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MeshType {
    /// Most vertices there can be.
    pub max_vertices: u32,
    /// Most triangles there can be.
    pub max_triangles: u32,
}

/// The type of an edge with its shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum EdgeType {
    /// 2D, 1, 2 or 4 channels.
    Image(ImageType),
    /// 3D, 1 or 4 channels.
    Volume(VolumeType),
    /// 1D, f32 or u32.
    Table(TableType),
    /// 1 to 4 f32.
    Scalar(ScalarType),
    /// Triangles.
    Mesh(MeshType),
}

/// The type of an edge without its shape: what the checker compares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum EdgeKind {
    /// 2D image.
    Image,
    /// 3D volume.
    Volume,
    /// 1D table.
    Table,
    /// 1 to 4 floats on the GPU.
    Scalar,
    /// Triangle mesh.
    Mesh,
}

impl EdgeKind {
    /// The name that graph files use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Image => "Image",
            Self::Volume => "Volume",
            Self::Table => "Table",
            Self::Scalar => "Scalar",
            Self::Mesh => "Mesh",
        }
    }
}

impl fmt::Display for EdgeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl EdgeType {
    /// A 32-bit float image.
    pub const fn image(size: [u32; 2], channels: u8) -> Self {
        Self::Image(ImageType::new(size, channels))
    }

    /// A 32-bit float volume.
    pub const fn volume(size: [u32; 3], channels: u8) -> Self {
        Self::Volume(VolumeType { size, channels, precision: Precision::F32 })
    }

    /// A table.
    pub const fn table(len: u32, element: Element) -> Self {
        Self::Table(TableType { len, element })
    }

    /// A scalar.
    pub const fn scalar(components: u8) -> Self {
        Self::Scalar(ScalarType { components })
    }

    /// The type without its shape.
    pub const fn kind(&self) -> EdgeKind {
        match self {
            Self::Image(_) => EdgeKind::Image,
            Self::Volume(_) => EdgeKind::Volume,
            Self::Table(_) => EdgeKind::Table,
            Self::Scalar(_) => EdgeKind::Scalar,
            Self::Mesh(_) => EdgeKind::Mesh,
        }
    }
}

impl fmt::Display for EdgeType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(t) => write!(f, "Image {}x{}, {} channel{}", t.size[0], t.size[1], t.channels, plural(t.channels)),
            Self::Volume(t) => {
                write!(f, "Volume {}x{}x{}, {} channel{}", t.size[0], t.size[1], t.size[2], t.channels, plural(t.channels))
            }
            Self::Table(t) => write!(f, "Table of {} {:?}", t.len, t.element),
            Self::Scalar(t) => write!(f, "Scalar of {}", t.components),
            Self::Mesh(t) => write!(f, "Mesh of at most {} triangles", t.max_triangles),
        }
    }
}

fn plural(n: u8) -> &'static str {
    if n == 1 { "" } else { "s" }
}
