//! TIFF: grey, RGB, with alpha or without, 8 and 16 bits, half and float, strips or tiles, planes or pixels; bilevel.
//! Palettes and CMYK are not read: the `tiff` crate refuses the one, and the other is no light without its profile.
//!
//! Written uncompressed by default: TIFF is what one hands to another program, and the next program reads that fastest.

use std::io::{Cursor, Read, Seek};

use tiff::decoder::{BufferLayoutPreference, Decoder, DecodingResult, Limits as Memory};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

use crate::colour::Colour;
use crate::error::Fault;
use crate::icc;
use crate::picture::{Alpha, Channels, Header, Layout, Metadata, Picture, Sample};
use crate::raster;
use crate::source::{Extent, Format, Limits};

mod encode;
mod rows;

pub(crate) use self::encode::{Strips, encode};
pub(crate) use self::rows::open as open_rows;

struct Opened<R: Read + Seek> {
    decoder: Decoder<R>,
    header: Header,
    kind: ColorType,
    layout: BufferLayoutPreference,
    profile: Option<Vec<u8>>,
    orientation: u16,
}

fn open<R: Read + Seek>(file: R, limits: &Limits, extent: Extent) -> Result<Opened<R>, Fault> {
    let mut memory = Memory::default();
    memory.decoding_buffer_size = limits.max_bytes as usize;
    memory.intermediate_buffer_size = limits.max_bytes as usize;
    memory.ifd_value_size = 64 << 20;
    let mut decoder = Decoder::new(file).map_err(fault)?.with_limits(memory);
    let (width, height) = decoder.dimensions().map_err(fault)?;
    limits.check_extent(extent, width.into(), height.into(), 16)?;
    let kind = decoder.colortype().map_err(fault)?;
    let layout = decoder.image_buffer_layout().map_err(fault)?;
    let channels = match kind {
        ColorType::Gray(_) => Channels::Y,
        ColorType::GrayA(_) | ColorType::Multiband { num_samples: 2, .. } => Channels::Ya,
        ColorType::RGB(_) => Channels::Rgb,
        ColorType::RGBA(_) => Channels::Rgba,
        other => return Err(Fault::unsupported(format!("pixels of type {other:?}; save it as grey or RGB"))),
    };
    let sample = match (layout.sample_format, kind.bit_depth()) {
        (tiff::tags::SampleFormat::Uint, 16) => Sample::U16,
        (tiff::tags::SampleFormat::Uint, 1 | 2 | 4 | 8) => Sample::U8,
        (tiff::tags::SampleFormat::IEEEFP, 16) => Sample::F16,
        (tiff::tags::SampleFormat::IEEEFP, 32 | 64) => Sample::F32,
        (format, bits) => return Err(Fault::unsupported(format!("{bits}-bit {format:?} samples"))),
    };
    let extra = decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples).ok().flatten().unwrap_or_default();
    let alpha = match (channels.has_alpha(), extra.first()) {
        (false, _) => Alpha::None,
        (true, Some(1)) => Alpha::Associated,
        (true, _) => Alpha::Straight,
    };
    let orientation = decoder.find_tag_unsigned::<u16>(Tag::Orientation).ok().flatten().unwrap_or(1);
    let profile = decoder.find_tag(Tag::IccProfile).ok().flatten().and_then(|value| value.into_u8_vec().ok());
    let compression = decoder.find_tag_unsigned::<u16>(Tag::Compression).ok().flatten();
    let compression = match compression {
        None | Some(1) => "none".to_owned(),
        Some(5) => "lzw".to_owned(),
        Some(7) => "jpeg".to_owned(),
        Some(8 | 32946) => "deflate".to_owned(),
        Some(32773) => "packbits".to_owned(),
        Some(other) => format!("method {other}"),
    };
    let header = Header {
        format: Format::Tiff,
        width,
        height,
        sample,
        channels,
        alpha,
        colour: if sample.is_float() { Colour::LINEAR_REC709 } else { Colour::SRGB },
        channel_names: Vec::new(),
        layers: Vec::new(),
        metadata: Metadata { sample: Some(sample), compression: Some(compression), had_alpha: channels.has_alpha(), ..Metadata::default() },
    };
    Ok(Opened { decoder, header, kind, layout, profile, orientation })
}

pub(crate) fn header(bytes: &[u8], limits: &Limits, profiles: bool) -> Result<Header, Fault> {
    let opened = open(Cursor::new(bytes), limits, Extent::Whole)?;
    let mut header = opened.header;
    if raster::exif_orientation(opened.orientation).is_some_and(raster::swaps_sides) {
        std::mem::swap(&mut header.width, &mut header.height);
    }
    header.apply_profile(opened.profile.as_deref().filter(|_| profiles));
    Ok(header)
}

pub(crate) fn decode(bytes: &[u8], limits: &Limits, profiles: bool) -> Result<Picture, Fault> {
    let Opened { mut decoder, header, kind, layout, profile, orientation } = open(Cursor::new(bytes), limits, Extent::Whole)?;
    let mut decoded = DecodingResult::U8(Vec::new());
    decoder.read_image_to_buffer(&mut decoded).map_err(fault)?;
    let pixels = samples(decoded, kind, header.width as usize, header.height as usize)?;
    let expected = Picture::byte_count(header.width, header.height, header.channels, header.sample);
    if expected != Some(pixels.len()) {
        return Err(Fault::damaged("its pixels do not fill its size"));
    }
    let memory = if layout.planes > 1 { Layout::Planar } else { Layout::Interleaved };
    let mut picture = header.picture(memory, pixels);
    if picture.layout == Layout::Planar {
        picture = interleave(picture);
    }
    if let Some(orientation) = raster::exif_orientation(orientation) {
        picture = raster::orient(picture, orientation);
    }
    icc::apply(profile.as_deref().filter(|_| profiles), picture)
}

/// What was decoded, as the bytes of a picture of this size.
fn samples(decoded: DecodingResult, kind: ColorType, width: usize, height: usize) -> Result<Vec<u8>, Fault> {
    let bytes = match decoded {
        DecodingResult::U8(values) => values,
        DecodingResult::U16(values) => bytemuck::cast_slice(&values).to_vec(),
        DecodingResult::F16(values) => values.iter().flat_map(|value| value.to_bits().to_ne_bytes()).collect(),
        DecodingResult::F32(values) => bytemuck::cast_slice(&values).to_vec(),
        DecodingResult::F64(values) => values.iter().flat_map(|&value| (value as f32).to_ne_bytes()).collect(),
        _ => return Err(Fault::unsupported("signed or 32-bit integer samples")),
    };
    match kind {
        ColorType::Gray(bits @ (1 | 2 | 4)) => unpack(&bytes, width, height, bits),
        _ => Ok(bytes),
    }
}

/// Grey of 1, 2 or 4 bits, rows padded to bytes → 8 bits.
fn unpack(packed: &[u8], width: usize, height: usize, bits: u8) -> Result<Vec<u8>, Fault> {
    let per_byte = 8 / usize::from(bits);
    let row_bytes = width.div_ceil(per_byte);
    if packed.len() < row_bytes * height {
        return Err(Fault::damaged("its pixels do not fill its size"));
    }
    let largest = (1_u8 << bits) - 1;
    let rows = packed.chunks_exact(row_bytes).take(height);
    Ok(rows
        .flat_map(|row| {
            (0..width).map(move |x| {
                let shift = 8 - usize::from(bits) * (x % per_byte + 1);
                ((row[x / per_byte] >> shift) & largest) * (255 / largest)
            })
        })
        .collect())
}

/// The ICC conversion and the orientation want pixels; planar TIFFs are rare enough to pay for it here.
fn interleave(picture: Picture) -> Picture {
    let (channels, size) = (picture.channels.count(), picture.sample.bytes());
    let plane = picture.bytes.len() / channels;
    let mut bytes = Vec::with_capacity(picture.bytes.len());
    for at in (0..plane).step_by(size) {
        for channel in 0..channels {
            bytes.extend_from_slice(&picture.bytes[channel * plane + at..channel * plane + at + size]);
        }
    }
    Picture { layout: Layout::Interleaved, bytes, ..picture }
}

fn fault(error: TiffError) -> Fault {
    match error {
        TiffError::UnsupportedError(error) => Fault::unsupported(error),
        TiffError::LimitsExceeded => Fault::TooLarge("it needs more memory than the limit".to_owned()),
        TiffError::IoError(_) => Fault::damaged("it ends too early"),
        other => Fault::damaged(other),
    }
}
