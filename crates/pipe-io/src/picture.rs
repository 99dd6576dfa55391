//! The host image: plain bytes in the file's own sample type, and what they mean.
//!
//! A picture keeps the samples as the file has them. Conversion to linear light, to the working primaries, to
//! associated alpha and to interleaved pixels is the GPU's work, where it costs nothing beside the upload; doing it
//! here was measured to be slower than the decoding itself. The codecs therefore convert only what no GPU pass could
//! (byte order, bit depths below 8, subsampled chroma, table-based ICC profiles).

use crate::colour::Colour;
use crate::exr::Attributes;

/// How one sample is stored; native byte order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sample {
    /// Unsigned 8-bit, 0..=255 standing for 0..=1.
    U8,
    /// Unsigned 16-bit, 0..=65535 standing for 0..=1.
    U16,
    /// IEEE 754 half.
    F16,
    /// IEEE 754 single.
    F32,
}

impl Sample {
    /// Bytes of one sample.
    pub const fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::F16 => 2,
            Self::F32 => 4,
        }
    }

    /// Whether values outside 0..=1 can be stored.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32)
    }

    /// As `--pixel-type` spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::U16 => "u16",
            Self::F16 => "half",
            Self::F32 => "float",
        }
    }
}

impl std::str::FromStr for Sample {
    type Err = crate::Error;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "u8" => Ok(Self::U8),
            "u16" => Ok(Self::U16),
            "half" => Ok(Self::F16),
            "float" => Ok(Self::F32),
            _ => Err(crate::Error::argument(text, "a pixel type: half, float, u8 or u16")),
        }
    }
}

/// In which order the samples of a picture follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Layout {
    /// All channels of a pixel, then the next pixel.
    Interleaved,
    /// All pixels of a channel (rows top to bottom), then the next channel, without padding between.
    Planar,
}

/// Which channels a picture has, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channels {
    /// One channel: grey, depth, a mask.
    Y,
    /// Grey and alpha; without [`Alpha`], two values of any meaning, which are red and green.
    Ya,
    /// Red, green, blue (or three values of any meaning, such as a normal).
    Rgb,
    /// Red, green, blue, alpha.
    Rgba,
}

impl Channels {
    /// How many, 1 to 4.
    pub const fn count(self) -> usize {
        match self {
            Self::Y => 1,
            Self::Ya => 2,
            Self::Rgb => 3,
            Self::Rgba => 4,
        }
    }

    /// Whether the last one is alpha.
    pub const fn has_alpha(self) -> bool {
        matches!(self, Self::Ya | Self::Rgba)
    }

    /// Whether there is only grey.
    pub const fn is_grey(self) -> bool {
        matches!(self, Self::Y | Self::Ya)
    }

    /// The channels with `count` members.
    pub const fn of_count(count: usize) -> Option<Self> {
        match count {
            1 => Some(Self::Y),
            2 => Some(Self::Ya),
            3 => Some(Self::Rgb),
            4 => Some(Self::Rgba),
            _ => None,
        }
    }
}

/// What the colour samples of a pixel mean beside its alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Alpha {
    /// There is no alpha channel; every pixel is opaque.
    None,
    /// Colour is already multiplied by alpha (in linear light).
    Associated,
    /// Colour is independent of alpha.
    Straight,
}

/// A rectangle of pixels in a file's own coordinates; `width` and `height` are at least 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Window {
    /// Left column; may be negative.
    pub x: i32,
    /// Top row; may be negative.
    pub y: i32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// What a file said beside its pixels, and what a writer needs to pass on.
#[derive(Clone, Debug, Default)]
pub struct Metadata {
    /// The sample type in the file, before anything was converted; `None` for a picture that came from no file, and
    /// for EXR's unsigned integers.
    pub sample: Option<Sample>,
    /// Compression in the file's own words (`zip`, `dwab`, `lzw`…), for reports.
    pub compression: Option<String>,
    /// Whether the file had an alpha channel.
    pub had_alpha: bool,
    /// Where the pixels that the file stores lie relative to the display window; `None` where the two are equal.
    pub data_window: Option<Window>,
    /// Width over height of a pixel; 1 for square ones.
    pub pixel_aspect: Option<f32>,
    /// Which layer or part was read; empty for the unnamed one.
    pub layer: String,
    /// Attributes of an EXR header, to be written to EXR outputs.
    pub attributes: Option<Attributes>,
}

/// An image in host memory.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Columns of the display window, at least 1.
    pub width: u32,
    /// Rows of the display window, at least 1.
    pub height: u32,
    /// How each sample is stored.
    pub sample: Sample,
    /// In which order samples follow each other.
    pub layout: Layout,
    /// Which channels there are.
    pub channels: Channels,
    /// What colour means beside alpha; `None` exactly when there is no alpha channel.
    pub alpha: Alpha,
    /// Primaries and transfer function of the stored values.
    pub colour: Colour,
    /// `width · height · channels.count() · sample.bytes()` bytes: rows top to bottom, no padding anywhere.
    pub bytes: Vec<u8>,
    /// What else the file said.
    pub metadata: Metadata,
}

impl Picture {
    /// Bytes that a picture of this size and type has; `None` where that overflows.
    pub fn byte_count(width: u32, height: u32, channels: Channels, sample: Sample) -> Option<usize> {
        (width as usize).checked_mul(height as usize)?.checked_mul(channels.count())?.checked_mul(sample.bytes())
    }

    /// The value of one sample as f32: integers scaled to 0..=1, no other conversion. For tests and for single
    /// pixels; `None` outside the picture.
    pub fn sample_at(&self, x: u32, y: u32, channel: usize) -> Option<f32> {
        if x >= self.width || y >= self.height || channel >= self.channels.count() {
            return None;
        }
        let pixel = y as usize * self.width as usize + x as usize;
        let index = match self.layout {
            Layout::Interleaved => pixel * self.channels.count() + channel,
            Layout::Planar => channel * self.width as usize * self.height as usize + pixel,
        };
        let at = index * self.sample.bytes();
        let bytes = self.bytes.get(at..at + self.sample.bytes())?;
        Some(match (self.sample, bytes) {
            (Sample::U8, &[a]) => f32::from(a) / 255.0,
            (Sample::U16, &[a, b]) => f32::from(u16::from_ne_bytes([a, b])) / 65535.0,
            (Sample::F16, &[a, b]) => half::f16::from_ne_bytes([a, b]).to_f32(),
            (Sample::F32, &[a, b, c, d]) => f32::from_ne_bytes([a, b, c, d]),
            _ => return None,
        })
    }
}

/// What a file's header says; nothing is decoded to learn it.
#[derive(Clone, Debug)]
pub struct Header {
    /// The file's format.
    pub format: crate::source::Format,
    /// Columns of the display window.
    pub width: u32,
    /// Rows of the display window.
    pub height: u32,
    /// How the samples of the picture will be stored once read.
    pub sample: Sample,
    /// Which channels the picture will have once read.
    pub channels: Channels,
    /// What colour will mean beside alpha.
    pub alpha: Alpha,
    /// Primaries and transfer function of the values.
    pub colour: Colour,
    /// The names of the channels that will be read, in the file's spelling.
    pub channel_names: Vec<String>,
    /// All layers and parts that `file#name` can choose from; empty for formats without.
    pub layers: Vec<String>,
    /// What else the file said.
    pub metadata: Metadata,
}

impl Header {
    /// The picture that this header describes, with these bytes.
    pub(crate) fn picture(self, layout: Layout, bytes: Vec<u8>) -> Picture {
        Picture {
            width: self.width,
            height: self.height,
            sample: self.sample,
            layout,
            channels: self.channels,
            alpha: self.alpha,
            colour: self.colour,
            bytes,
            metadata: self.metadata,
        }
    }

    /// Changes what an ICC profile will change about the picture.
    pub(crate) fn apply_profile(&mut self, profile: Option<&[u8]>) {
        use crate::icc::Meaning;
        let Some(profile) = profile.filter(|_| !self.sample.is_float()) else { return };
        match crate::icc::meaning(profile, self.channels.is_grey()) {
            Meaning::Tag(colour) => self.colour = colour,
            Meaning::Convert(_) => {
                self.colour = Colour::LINEAR_REC709;
                self.sample = Sample::F32;
                self.channels = if self.channels.has_alpha() { Channels::Rgba } else { Channels::Rgb };
            }
            Meaning::Ignore => {}
        }
    }
}
