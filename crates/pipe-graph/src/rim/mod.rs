//! The rim: how pixels lie in the host's memory on their way in and out of the GPU.
//!
//! Files are decoded into words exactly as they were stored (8-bit, half, planar …); the first pass of a plan
//! turns them into linear, associated RGBA and the last one turns them back, so the bus carries the fewest bytes
//! and both conversions can be fused into their neighbours.

mod passes;

use serde::Serialize;

pub use passes::{fetch_image, fetch_volume, fetch_words, ingest_image, ingest_volume};

/// The type of a stored sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum Sample {
    /// 0..255 stands for 0..1.
    U8,
    /// 0..65535 stands for 0..1.
    U16,
    /// Half float.
    F16,
    /// Float.
    F32,
}

impl Sample {
    /// Bytes of one sample.
    pub const fn bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::F16 => 2,
            Self::F32 => 4,
        }
    }
}

/// The type of a stored voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[allow(missing_docs)]
pub enum Voxel {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F16,
    F32,
}

impl Voxel {
    /// Bytes of one number.
    pub const fn bytes(self) -> u64 {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
        }
    }
}

/// How the voxels of a volume lie in host memory: x fastest, the channels of a voxel together, without padding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct VoxelForm {
    /// Voxels along x, y and z.
    pub size: [u32; 3],
    /// 1 to 4. Two become (u, v, 0, 1), three have alpha 1.
    pub channels: u8,
    /// Type of the numbers.
    pub voxel: Voxel,
    /// Value = number × scale + offset.
    pub scale: f32,
    /// See `scale`.
    pub offset: f32,
}

impl VoxelForm {
    /// Floats that stand for themselves: what needs no conversion.
    pub const fn plain(size: [u32; 3], channels: u8) -> Self {
        Self { size, channels, voxel: Voxel::F32, scale: 1.0, offset: 0.0 }
    }

    /// Channels of the volume inside the graph.
    pub const fn volume_channels(&self) -> u8 {
        if self.channels == 1 { 1 } else { 4 }
    }
}

/// Order of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum Layout {
    /// All channels of a pixel together; rows without padding.
    Interleaved,
    /// One channel after the other; rows and planes without padding.
    Planar,
}

/// What alpha means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum Alpha {
    /// There is none: 1 on the way in, dropped on the way out.
    None,
    /// Colour already multiplied by it.
    Associated,
    /// Colour not multiplied by it.
    Straight,
}

/// From stored values to linear light.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Transfer {
    /// Stored values are linear.
    Linear,
    /// IEC 61966-2-1.
    Srgb,
    /// encoded = linear^(1/γ).
    Gamma(f32),
}

/// How the pixels of one image lie in host memory.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PixelForm {
    /// Width and height.
    pub size: [u32; 2],
    /// 1 (Y), 2 (Y and alpha; without alpha a pair of fields), 3 (RGB) or 4 (RGBA).
    pub channels: u8,
    /// Sample type.
    pub sample: Sample,
    /// Sample order.
    pub layout: Layout,
    /// Alpha convention.
    pub alpha: Alpha,
    /// Transfer function of the stored values.
    pub transfer: Transfer,
    /// On the way in: linear stored RGB to linear Rec.709. On the way out: the inverse direction.
    /// Row-major: out\[i\] = Σ matrix\[i\]\[j\]·in\[j\].
    pub matrix: [[f32; 3]; 3],
}

impl PixelForm {
    /// Linear Rec.709 floats, interleaved, associated alpha: what needs no conversion.
    pub const fn linear(size: [u32; 2], channels: u8) -> Self {
        Self {
            size,
            channels,
            sample: Sample::F32,
            layout: Layout::Interleaved,
            alpha: if channels == 4 { Alpha::Associated } else { Alpha::None },
            transfer: Transfer::Linear,
            matrix: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        }
    }

    /// Whether decoded pixels are the halves that the file holds.
    pub fn keeps_halves(&self) -> bool {
        let plain = Self::linear(self.size, self.channels);
        self.sample == Sample::F16 && self.transfer == Transfer::Linear && self.alpha != Alpha::Straight && self.matrix == plain.matrix
    }

    /// Bytes of all samples, without padding.
    pub const fn bytes(&self) -> u64 {
        self.size[0] as u64 * self.size[1] as u64 * self.channels as u64 * self.sample.bytes()
    }

    /// 32-bit words that hold them.
    pub const fn words(&self) -> u64 {
        self.bytes().div_ceil(4)
    }

    /// Channels of the image inside the graph: 1 for grey, 2 for a pair of fields, 4 otherwise.
    pub const fn image_channels(&self) -> u8 {
        match (self.channels, self.alpha) {
            (1, _) => 1,
            (2, Alpha::None) => 2,
            _ => 4,
        }
    }
}
