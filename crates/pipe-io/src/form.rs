//! In which form a writer wants its pixels.
//!
//! The pixels come from the GPU, whose last kernel can store any sample type, channel count, alpha and transfer
//! function for free. So before anything runs the caller asks for the [`Form`] of its output, packs the pixels to it,
//! and [`write`](crate::write) then only compresses bytes. A combination that the format cannot hold is refused here,
//! before any work is done.

use std::str::FromStr;

use crate::colour::{Colorspace, Colour};
use crate::error::{Error, Fault, Result};
use crate::picture::{Alpha, Channels, Layout, Metadata, Picture, Sample};
use crate::source::{Format, Target};

/// How a file is compressed. Each format has some of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Compression {
    /// EXR, TIFF: not at all.
    None,
    /// EXR: run lengths; lossless.
    Rle,
    /// EXR: deflate, single lines; lossless.
    Zips,
    /// EXR: deflate, 16 lines; lossless.
    Zip,
    /// EXR: wavelet and Huffman; lossless.
    Piz,
    /// EXR: deflate after rounding float to 24 bits; lossless for half.
    Pxr24,
    /// EXR: 4×4 blocks of fixed rate; lossy for half.
    B44,
    /// EXR: the same, flat blocks smaller; lossy for half.
    B44a,
    /// EXR: discrete cosine transform, 32 lines; lossy.
    Dwaa,
    /// EXR: discrete cosine transform, 256 lines; lossy.
    Dwab,
    /// TIFF: Lempel-Ziv-Welch.
    Lzw,
    /// TIFF: deflate.
    Deflate,
    /// TIFF: run lengths.
    Packbits,
    /// PNG: hundreds of megapixels a second.
    Fastest,
    /// PNG: a tenth of that speed, smaller.
    Balanced,
    /// PNG: as small as the encoder can.
    Best,
}

impl Compression {
    const ALL: [Self; 16] = [
        Self::None,
        Self::Rle,
        Self::Zips,
        Self::Zip,
        Self::Piz,
        Self::Pxr24,
        Self::B44,
        Self::B44a,
        Self::Dwaa,
        Self::Dwab,
        Self::Lzw,
        Self::Deflate,
        Self::Packbits,
        Self::Fastest,
        Self::Balanced,
        Self::Best,
    ];

    /// As `--compression` spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Rle => "rle",
            Self::Zips => "zips",
            Self::Zip => "zip",
            Self::Piz => "piz",
            Self::Pxr24 => "pxr24",
            Self::B44 => "b44",
            Self::B44a => "b44a",
            Self::Dwaa => "dwaa",
            Self::Dwab => "dwab",
            Self::Lzw => "lzw",
            Self::Deflate => "deflate",
            Self::Packbits => "packbits",
            Self::Fastest => "fastest",
            Self::Balanced => "balanced",
            Self::Best => "best",
        }
    }

    /// What a format can be compressed with, its default first; empty where there is no choice.
    pub const fn of(format: Format) -> &'static [Self] {
        match format {
            Format::Exr => {
                &[Self::Zip, Self::None, Self::Rle, Self::Zips, Self::Piz, Self::Pxr24, Self::B44, Self::B44a, Self::Dwaa, Self::Dwab]
            }
            Format::Png | Format::Apng => &[Self::Fastest, Self::Balanced, Self::Best],
            Format::Tiff => &[Self::None, Self::Lzw, Self::Deflate, Self::Packbits],
            _ => &[],
        }
    }
}

impl FromStr for Compression {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|method| method.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            Error::argument(text, format!("a compression: {names}"))
        })
    }
}

/// What the user asked of an output.
#[derive(Clone, Debug)]
pub struct WriteOptions {
    /// `--pixel-type`; `None` for the format's default (EXR: the input's type).
    pub pixel_type: Option<Sample>,
    /// `--compression`; `None` for the format's default (EXR: zip, PNG: fastest, TIFF: none).
    pub compression: Option<Compression>,
    /// `--out-colorspace`; `None` for sRGB in integer formats and linear Rec.709 in float ones.
    pub colorspace: Option<Colorspace>,
    /// The channels that the picture has; a format that lacks alpha drops it, one that lacks grey writes RGB.
    /// `None` for RGB, with alpha where the input had it.
    pub channels: Option<Channels>,
    /// JPEG quality, 1 to 100.
    pub quality: u8,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { pixel_type: None, compression: None, colorspace: None, channels: None, quality: 95 }
    }
}

/// The exact form in which a writer wants its pixels; the fields mean what they mean in [`Picture`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// How each sample is stored.
    pub sample: Sample,
    /// In which order samples follow each other.
    pub layout: Layout,
    /// Which channels there are.
    pub channels: Channels,
    /// What colour means beside alpha.
    pub alpha: Alpha,
    /// Primaries and transfer function of the stored values.
    pub colour: Colour,
}

impl Form {
    /// A picture of this form; `bytes` are the packed pixels.
    pub fn picture(&self, width: u32, height: u32, bytes: Vec<u8>, metadata: Metadata) -> Picture {
        let Self { sample, layout, channels, alpha, colour } = *self;
        Picture { width, height, sample, layout, channels, alpha, colour, bytes, metadata }
    }
}

/// What a format can hold: sample types (the default first) and channels.
const fn holds(format: Format) -> (&'static [Sample], &'static [Channels]) {
    use Channels::{Rgb, Rgba, Y, Ya};
    use Sample::{F16, F32, U8, U16};
    match format {
        Format::Exr => (&[F32, F16], &[Y, Ya, Rgb, Rgba]),
        Format::Png | Format::Apng => (&[U8, U16], &[Y, Ya, Rgb, Rgba]),
        Format::Gif => (&[U8], &[Rgb, Rgba]),
        Format::Tiff => (&[U8, U16, F32], &[Y, Ya, Rgb, Rgba]),
        Format::Jpeg => (&[U8], &[Y, Rgb]),
        Format::WebP => (&[U8], &[Y, Ya, Rgb, Rgba]),
        Format::Qoi => (&[U8], &[Rgb, Rgba]),
        Format::Hdr => (&[F32], &[Rgb]),
        Format::Pfm => (&[F32], &[Y, Rgb]),
        Format::Npy => (&[F32, F16, U8, U16], &[Y, Ya, Rgb, Rgba]),
    }
}

/// The form in which `target` wants its pixels. `source` is the metadata of the input that the output follows (pixel
/// type and alpha of EXR), if there is one.
pub fn output_form(target: &Target, options: &WriteOptions, source: Option<&Metadata>) -> Result<Form> {
    form_of(target.format, options, source).map_err(|fault| fault.of(target, target.format))
}

fn form_of(format: Format, options: &WriteOptions, source: Option<&Metadata>) -> Result<Form, Fault> {
    let (samples, held) = holds(format);
    let sample = match options.pixel_type {
        Some(asked) if samples.contains(&asked) => asked,
        Some(asked) => {
            let names: Vec<_> = samples.iter().map(|sample| sample.name()).collect();
            let (name, asked) = (format.name(), asked.name());
            return Err(Fault::Form(format!("{name} cannot hold pixels of type {asked}, only {}", names.join(" or "))));
        }
        None => match source.and_then(|metadata| metadata.sample) {
            Some(sample) if format == Format::Exr && sample.is_float() => sample,
            _ => samples[0],
        },
    };
    compression_of(format, options)?;
    if format == Format::Jpeg && !(1..=100).contains(&options.quality) {
        return Err(Fault::Form(format!("a JPEG quality is 1 to 100, not {}", options.quality)));
    }
    let had_alpha = source.is_some_and(|metadata| metadata.had_alpha);
    let wanted = options.channels.unwrap_or(if had_alpha { Channels::Rgba } else { Channels::Rgb });
    let nearest: &[Channels] = match wanted {
        Channels::Y => &[Channels::Y, Channels::Rgb],
        Channels::Ya => &[Channels::Ya, Channels::Rgba, Channels::Y, Channels::Rgb],
        Channels::Rgb => &[Channels::Rgb],
        Channels::Rgba => &[Channels::Rgba, Channels::Rgb],
    };
    let channels = nearest.iter().copied().find(|channels| held.contains(channels)).unwrap_or(Channels::Rgb);
    let default = if sample.is_float() || format == Format::Npy { Colorspace::LinearRec709 } else { Colorspace::Srgb };
    Ok(Form {
        sample,
        layout: if format == Format::Exr { Layout::Planar } else { Layout::Interleaved },
        channels,
        alpha: match (channels.has_alpha(), sample.is_float() || format == Format::Npy) {
            (false, _) => Alpha::None,
            (true, true) => Alpha::Associated,
            (true, false) => Alpha::Straight,
        },
        colour: options.colorspace.unwrap_or(default).colour(),
    })
}

/// The compression that will be used; [`Compression::None`] where the format has no choice.
pub(crate) fn compression_of(format: Format, options: &WriteOptions) -> Result<Compression, Fault> {
    let known = Compression::of(format);
    match options.compression {
        None => Ok(known.first().copied().unwrap_or(Compression::None)),
        Some(asked) if known.contains(&asked) => Ok(asked),
        Some(asked) => {
            let (name, asked) = (format.name(), asked.name());
            let names: Vec<_> = known.iter().map(|method| method.name()).collect();
            Err(Fault::Form(match known {
                [] => format!("{name} has no choice of compression; leave `{asked}` out"),
                _ => format!("{name} has no compression `{asked}`, only {}", names.join(", ")),
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn form(name: &str, options: &WriteOptions, source: Option<&Metadata>) -> Result<Form> {
        output_form(&Target::parse(name).unwrap(), options, source)
    }

    #[test]
    fn exr_follows_its_input() {
        let half = Metadata { sample: Some(Sample::F16), had_alpha: true, ..Metadata::default() };
        let got = form("a.exr", &WriteOptions::default(), Some(&half)).unwrap();
        assert_eq!((got.sample, got.channels, got.alpha), (Sample::F16, Channels::Rgba, Alpha::Associated));
        let byte = Metadata { sample: Some(Sample::U8), ..Metadata::default() };
        assert_eq!(form("a.exr", &WriteOptions::default(), Some(&byte)).unwrap().sample, Sample::F32);
        assert_eq!(form("a.exr", &WriteOptions::default(), None).unwrap().sample, Sample::F32);
    }

    #[test]
    fn what_a_format_lacks_is_dropped_or_refused() {
        let rgba = WriteOptions { channels: Some(Channels::Rgba), ..WriteOptions::default() };
        for (name, channels) in [("a.jpg", Channels::Rgb), ("a.hdr", Channels::Rgb), ("a.png", Channels::Rgba)] {
            assert_eq!(form(name, &rgba, None).unwrap().channels, channels);
        }
        let half = WriteOptions { pixel_type: Some(Sample::F16), ..WriteOptions::default() };
        let error = form("a.png", &half, None).unwrap_err().to_string();
        assert_eq!(error, "cannot write `a.png`: PNG cannot hold pixels of type half, only u8 or u16");
        let lzw = WriteOptions { compression: Some(Compression::Lzw), ..WriteOptions::default() };
        assert!(form("a.exr", &lzw, None).unwrap_err().to_string().contains("zip, none, rle"));
        assert!(form("a.qoi", &lzw, None).unwrap_err().to_string().contains("leave `lzw` out"));
    }

    #[test]
    fn integers_are_srgb_and_floats_are_linear() {
        let transfer = |name| form(name, &WriteOptions::default(), None).unwrap().colour;
        assert_eq!(transfer("a.png"), Colour::SRGB);
        assert_eq!(transfer("a.exr"), Colour::LINEAR_REC709);
        let raw = WriteOptions { colorspace: Some(Colorspace::Raw), ..WriteOptions::default() };
        assert_eq!(form("a.png", &raw, None).unwrap().colour, Colour::LINEAR_REC709);
    }
}
