//! PNG: all colour types and bit depths in; grey, grey + alpha, RGB, RGBA at 8 and 16 bits out.
//!
//! The default for writing is `png`'s Fastest (fdeflate behind a fixed filter): about 240 Mpx/s against 14 for
//! Balanced, and a preview or a frame of a sequence is written far more often than it is stored for good.

use std::io::{Cursor, Write};

use crate::colour::{Colour, Primaries, Transfer};
use crate::error::Fault;
use crate::form::Compression;
use crate::icc;
use crate::picture::{Alpha, Channels, Header, Layout, Metadata, Picture, Sample};
use crate::source::{Format, Limits};

type Reader<'a> = png::Reader<Cursor<&'a [u8]>>;

fn open<'a>(bytes: &'a [u8], limits: &Limits) -> Result<(Reader<'a>, Header), Fault> {
    let memory = png::Limits { bytes: limits.max_bytes as usize };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), memory);
    decoder.set_transformations(png::Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    let info = decoder.read_header_info().map_err(fault)?;
    limits.check(info.width.into(), info.height.into(), 8)?;
    let reader = decoder.read_info().map_err(fault)?;
    let info = reader.info();
    let (kind, depth) = reader.output_color_type();
    let channels = match kind {
        png::ColorType::Grayscale => Channels::Y,
        png::ColorType::GrayscaleAlpha => Channels::Ya,
        png::ColorType::Rgb | png::ColorType::Indexed => Channels::Rgb,
        png::ColorType::Rgba => Channels::Rgba,
    };
    let sample = if depth == png::BitDepth::Sixteen { Sample::U16 } else { Sample::U8 };
    let header = Header {
        format: Format::Png,
        width: info.width,
        height: info.height,
        sample,
        channels,
        alpha: if channels.has_alpha() { Alpha::Straight } else { Alpha::None },
        colour: colour(info),
        channel_names: Vec::new(),
        layers: Vec::new(),
        metadata: Metadata { sample: Some(sample), had_alpha: channels.has_alpha(), ..Metadata::default() },
    };
    Ok((reader, header))
}

pub(crate) fn header(bytes: &[u8], limits: &Limits, profiles: bool) -> Result<Header, Fault> {
    let (reader, mut header) = open(bytes, limits)?;
    header.apply_profile(profile(reader.info()).filter(|_| profiles));
    Ok(header)
}

/// The ICC profile, where nothing in the file outranks it.
fn profile<'a>(info: &'a png::Info<'_>) -> Option<&'a [u8]> {
    info.icc_profile.as_deref().filter(|_| cicp(info).is_none())
}

pub(crate) fn decode(bytes: &[u8], limits: &Limits, profiles: bool) -> Result<Picture, Fault> {
    let (mut reader, header) = open(bytes, limits)?;
    let size = reader.output_buffer_size().ok_or_else(|| Fault::damaged("its size overflows"))?;
    let mut pixels = vec![0; size];
    reader.next_frame(&mut pixels).map_err(fault)?;
    if header.sample == Sample::U16 {
        swap_to_native(&mut pixels);
    }
    icc::apply(profile(reader.info()).filter(|_| profiles), header.picture(Layout::Interleaved, pixels))
}

/// The meaning of the values by the chunks of the file, most exact first (PNG 3, section 4.3); ICC comes later.
fn colour(info: &png::Info<'_>) -> Colour {
    if let Some(colour) = cicp(info) {
        return colour;
    }
    if info.srgb.is_some() {
        return Colour::SRGB;
    }
    let gamma = info.gama_chunk.map(png::ScaledFloat::into_value).filter(|&gamma| gamma > 0.0);
    let transfer = match gamma {
        None => Transfer::Srgb,
        Some(gamma) if (gamma - 1.0).abs() < 1e-3 => Transfer::Linear,
        // Writers that mean sRGB say 1/2.2 for readers that know no better; the sRGB chunk, where present, won above.
        Some(gamma) => Transfer::Gamma(1.0 / gamma),
    };
    let primaries = info.chrm_chunk.map_or(Primaries::REC709, |xy| {
        let point = |(x, y): (png::ScaledFloat, png::ScaledFloat)| [x, y].map(|value| f64::from(value.into_value()));
        let primaries = Primaries { red: point(xy.red), green: point(xy.green), blue: point(xy.blue), white: point(xy.white) };
        if primaries.to_xyz().is_some() { primaries.snapped() } else { Primaries::REC709 }
    });
    Colour { primaries, transfer }
}

/// The cICP chunk (ITU-T H.273), as far as its transfer is one of ours.
fn cicp(info: &png::Info<'_>) -> Option<Colour> {
    let code = info.coding_independent_code_points.as_ref()?;
    let primaries = match code.color_primaries {
        1 => Primaries::REC709,
        9 => Primaries::REC2020,
        12 => Primaries::P3,
        _ => return None,
    };
    let transfer = match code.transfer_function {
        4 => Transfer::Gamma(2.2),
        8 => Transfer::Linear,
        13 => Transfer::Srgb,
        _ => return None,
    };
    Some(Colour { primaries, transfer })
}

pub(crate) fn encode(out: &mut dyn Write, picture: &Picture, compression: Compression, tag_colour: bool) -> Result<(), Fault> {
    let mut writer = encoder(out, picture, compression, tag_colour).write_header().map_err(failure)?;
    put(&mut writer, picture)?;
    writer.finish().map_err(failure)
}

/// An encoder for pictures like this one.
pub(crate) fn encoder<W: Write>(out: W, picture: &Picture, compression: Compression, tag_colour: bool) -> png::Encoder<'static, W> {
    let mut encoder = png::Encoder::new(out, picture.width, picture.height);
    encoder.set_color(match picture.channels {
        Channels::Y => png::ColorType::Grayscale,
        Channels::Ya => png::ColorType::GrayscaleAlpha,
        Channels::Rgb => png::ColorType::Rgb,
        Channels::Rgba => png::ColorType::Rgba,
    });
    encoder.set_depth(if picture.sample == Sample::U16 { png::BitDepth::Sixteen } else { png::BitDepth::Eight });
    encoder.set_compression(match compression {
        Compression::Balanced => png::Compression::Balanced,
        Compression::Best => png::Compression::High,
        _ => png::Compression::Fastest,
    });
    if tag_colour {
        tag(&mut encoder, &picture.colour);
    }
    encoder
}

/// Writes the pixels of one frame.
pub(crate) fn put<W: Write>(writer: &mut png::Writer<W>, picture: &Picture) -> Result<(), Fault> {
    if picture.sample == Sample::U16 {
        let mut swapped = picture.bytes.clone();
        swap_to_native(&mut swapped);
        writer.write_image_data(&swapped).map_err(failure)
    } else {
        writer.write_image_data(&picture.bytes).map_err(failure)
    }
}

fn tag<W: Write>(encoder: &mut png::Encoder<'_, W>, colour: &Colour) {
    if *colour == Colour::SRGB {
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        return;
    }
    match colour.transfer {
        Transfer::Linear => encoder.set_source_gamma(png::ScaledFloat::new(1.0)),
        Transfer::Gamma(gamma) => encoder.set_source_gamma(png::ScaledFloat::new(1.0 / gamma)),
        Transfer::Srgb => {}
    }
    let point = |[x, y]: [f64; 2]| (png::ScaledFloat::new(x as f32), png::ScaledFloat::new(y as f32));
    let p = &colour.primaries;
    encoder.set_source_chromaticities(png::SourceChromaticities {
        white: point(p.white),
        red: point(p.red),
        green: point(p.green),
        blue: point(p.blue),
    });
}

/// Big endian ↔ native, both ways.
fn swap_to_native(bytes: &mut [u8]) {
    for word in bytes.as_chunks_mut::<2>().0 {
        *word = u16::from_be_bytes(*word).to_ne_bytes();
    }
}

fn fault(error: png::DecodingError) -> Fault {
    match error {
        png::DecodingError::LimitsExceeded => Fault::TooLarge("it needs more memory than the limit".to_owned()),
        png::DecodingError::IoError(_) => Fault::damaged("it ends too early"),
        other => Fault::damaged(other),
    }
}

pub(crate) fn failure(error: png::EncodingError) -> Fault {
    match error {
        png::EncodingError::IoError(error) => Fault::Io(error),
        other => Fault::Form(other.to_string()),
    }
}
