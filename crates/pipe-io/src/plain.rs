//! The formats with next to no structure: PFM and NPY images.
//!
//! PFM is read and written here because the `image` crate has it in no release that also reads big-endian files, and
//! it is forty lines. Its rows go from bottom to top; the sign of its scale is the byte order (negative: little).

use std::io::Write;

use crate::colour::Colour;
use crate::error::Fault;
use crate::npy::{self, Array, Element};
use crate::picture::{Alpha, Channels, Header, Layout, Metadata, Picture, Sample};
use crate::source::{Format, Limits};

fn linear(format: Format, width: usize, height: usize, channels: Channels, sample: Sample) -> Header {
    Header {
        format,
        width: width as u32,
        height: height as u32,
        sample,
        channels,
        alpha: if channels.has_alpha() { Alpha::Associated } else { Alpha::None },
        colour: Colour::LINEAR_REC709,
        channel_names: Vec::new(),
        layers: Vec::new(),
        metadata: Metadata { sample: Some(sample), had_alpha: channels.has_alpha(), ..Metadata::default() },
    }
}

/// Reads a PFM header; also tells where the data begins and whether it is big-endian.
fn pfm(bytes: &[u8], limits: &Limits) -> Result<(Header, usize, bool), Fault> {
    let mut at = 2;
    let mut word = || {
        let rest = bytes.get(at..)?;
        let start = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let length = rest[start..].iter().take(64).position(u8::is_ascii_whitespace)?;
        at += start + length;
        std::str::from_utf8(&rest[start..start + length]).ok()
    };
    let (width, height, scale) = (word(), word(), word());
    let number = |text: Option<&str>| text.and_then(|text| text.parse::<u32>().ok());
    let (Some(width), Some(height)) = (number(width), number(height)) else {
        return Err(Fault::damaged("its second line is not a width and a height"));
    };
    let scale = scale.and_then(|text| text.parse::<f32>().ok()).filter(|scale| *scale != 0.0 && scale.is_finite());
    let scale = scale.ok_or_else(|| Fault::damaged("its third line is not a scale"))?;
    let channels = if bytes[1] == b'F' { Channels::Rgb } else { Channels::Y };
    limits.check(width.into(), height.into(), channels.count() as u64 * 4)?;
    // One white-space byte ends the header.
    Ok((linear(Format::Pfm, width as usize, height as usize, channels, Sample::F32), at + 1, scale > 0.0))
}

pub(crate) fn pfm_header(bytes: &[u8], limits: &Limits) -> Result<Header, Fault> {
    Ok(pfm(bytes, limits)?.0)
}

pub(crate) fn pfm_decode(bytes: &[u8], limits: &Limits) -> Result<Picture, Fault> {
    let (header, start, big_endian) = pfm(bytes, limits)?;
    let row = header.width as usize * header.channels.count() * 4;
    let data = bytes.get(start..).and_then(|rest| rest.get(..row * header.height as usize));
    let data = data.ok_or_else(|| Fault::damaged("it is shorter than its size says"))?;
    let mut pixels = Vec::with_capacity(data.len());
    for line in data.chunks_exact(row).rev() {
        pixels.extend_from_slice(line);
    }
    if big_endian != cfg!(target_endian = "big") {
        pixels.chunks_exact_mut(4).for_each(<[u8]>::reverse);
    }
    Ok(header.picture(Layout::Interleaved, pixels))
}

pub(crate) fn pfm_encode(out: &mut dyn Write, picture: &Picture) -> Result<(), Fault> {
    let (kind, scale) =
        (if picture.channels == Channels::Y { "Pf" } else { "PF" }, if cfg!(target_endian = "big") { "1.0" } else { "-1.0" });
    let row = picture.width as usize * picture.channels.count() * 4;
    write!(out, "{kind}\n{} {}\n{scale}\n", picture.width, picture.height).map_err(Fault::Io)?;
    picture.bytes.chunks_exact(row).rev().try_for_each(|line| out.write_all(line)).map_err(Fault::Io)
}

fn npy_shape<'a>(bytes: &'a [u8], limits: &Limits) -> Result<(Header, Array<'a>), Fault> {
    let array = Array::parse(bytes)?;
    let sample = match array.element {
        Element::U8 => Sample::U8,
        Element::U16 => Sample::U16,
        Element::F16 => Sample::F16,
        Element::F32 | Element::F64 => Sample::F32,
        Element::I8 | Element::I16 | Element::U32 | Element::I32 => {
            return Err(Fault::unsupported("an image of signed or 32-bit integers; save it as float"));
        }
    };
    let (height, width, count) = match *array.shape.as_slice() {
        [height, width] => (height, width, 1),
        [height, width, count] => (height, width, count),
        _ => return Err(Fault::unsupported("an array that is neither h×w nor h×w×c; reshape it")),
    };
    let channels = Channels::of_count(count)
        .ok_or_else(|| Fault::unsupported(format!("{count} channels; an image has 1 to 4, along the last axis")))?;
    limits.check(width as u64, height as u64, (count * array.element.bytes()) as u64)?;
    Ok((linear(Format::Npy, width, height, channels, sample), array))
}

pub(crate) fn npy_header(bytes: &[u8], limits: &Limits) -> Result<Header, Fault> {
    Ok(npy_shape(bytes, limits)?.0)
}

pub(crate) fn npy_decode(bytes: &[u8], limits: &Limits) -> Result<Picture, Fault> {
    let (header, array) = npy_shape(bytes, limits)?;
    let mut pixels = array.native()?;
    if array.element == Element::F64 {
        let doubles = pixels.as_chunks::<8>().0;
        pixels = doubles.iter().flat_map(|&eight| (f64::from_ne_bytes(eight) as f32).to_ne_bytes()).collect();
    }
    Ok(header.picture(Layout::Interleaved, pixels))
}

pub(crate) fn npy_encode(out: &mut dyn Write, picture: &Picture) -> Result<(), Fault> {
    let element = match picture.sample {
        Sample::U8 => Element::U8,
        Sample::U16 => Element::U16,
        Sample::F16 => Element::F16,
        Sample::F32 => Element::F32,
    };
    let (width, height, count) = (picture.width as usize, picture.height as usize, picture.channels.count());
    let shape = if count == 1 { vec![height, width] } else { vec![height, width, count] };
    out.write_all(&npy::header(element, &shape)).map_err(Fault::Io)?;
    out.write_all(&npy::to_little_endian(element, &picture.bytes)).map_err(Fault::Io)
}
