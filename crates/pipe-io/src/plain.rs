//! The formats with next to no structure: PFM and NPY images.
//!
//! PFM is read and written here because the `image` crate has it in no release that also reads big-endian files, and
//! it is forty lines. Its rows go from bottom to top; the sign of its scale is the byte order (negative: little).

use std::fs::File;
use std::io::{Read, Write};

use crate::colour::Colour;
use crate::error::Fault;
use crate::npy::{self, Array, Element};
use crate::picture::{Alpha, Channels, Header, Layout, Metadata, Picture, Sample};
use crate::rows::{Number, Order, Streamed, Strided};
use crate::source::{Extent, Format, Limits};

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
fn pfm(bytes: &[u8], limits: &Limits, extent: Extent) -> Result<(Header, usize, bool), Fault> {
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
    limits.check_extent(extent, width.into(), height.into(), channels.count() as u64 * 4)?;
    // One white-space byte ends the header.
    Ok((linear(Format::Pfm, width as usize, height as usize, channels, Sample::F32), at + 1, scale > 0.0))
}

pub(crate) fn pfm_header(bytes: &[u8], limits: &Limits) -> Result<Header, Fault> {
    Ok(pfm(bytes, limits, Extent::Whole)?.0)
}

pub(crate) fn pfm_decode(bytes: &[u8], limits: &Limits) -> Result<Picture, Fault> {
    let (header, start, big_endian) = pfm(bytes, limits, Extent::Whole)?;
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

/// Reads the header of a file on disk.
pub(crate) fn pfm_open_rows(mut file: File, limits: &Limits) -> Result<Option<Streamed>, Fault> {
    let beginning = beginning(&mut file, 1 << 10)?;
    let (header, start, big_endian) = pfm(&beginning, limits, Extent::Rows)?;
    let order = Order::Up { bottom: start as u64, height: header.height as usize };
    Strided::open(file, header, order, Number { bytes: 4, big_endian, double: false }).map(Some)
}

/// The header of a picture like this one, whose bottom row follows it.
pub(crate) fn pfm_head(like: &Picture) -> Vec<u8> {
    let kind = if like.channels == Channels::Y { "Pf" } else { "PF" };
    let scale = if cfg!(target_endian = "big") { "1.0" } else { "-1.0" };
    format!("{kind}\n{} {}\n{scale}\n", like.width, like.height).into_bytes()
}

pub(crate) fn pfm_encode(out: &mut dyn Write, picture: &Picture) -> Result<(), Fault> {
    let row = picture.width as usize * picture.channels.count() * 4;
    out.write_all(&pfm_head(picture)).map_err(Fault::Io)?;
    picture.bytes.chunks_exact(row).rev().try_for_each(|line| out.write_all(line)).map_err(Fault::Io)
}

fn npy_shape<'a>(bytes: &'a [u8], limits: &Limits, extent: Extent) -> Result<(Header, Array<'a>), Fault> {
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
    limits.check_extent(extent, width as u64, height as u64, (count * array.element.bytes()) as u64)?;
    let mut header = linear(Format::Npy, width, height, channels, sample);
    if count == 2 {
        // Vectors, places, states: an array does not say that its second number is alpha, and mostly it is not.
        (header.alpha, header.metadata.had_alpha) = (Alpha::None, false);
    }
    Ok((header, array))
}

pub(crate) fn npy_header(bytes: &[u8], limits: &Limits) -> Result<Header, Fault> {
    Ok(npy_shape(bytes, limits, Extent::Whole)?.0)
}

pub(crate) fn npy_decode(bytes: &[u8], limits: &Limits) -> Result<Picture, Fault> {
    let (header, array) = npy_shape(bytes, limits, Extent::Whole)?;
    let mut pixels = array.native()?;
    if array.element == Element::F64 {
        let doubles = pixels.as_chunks::<8>().0;
        pixels = doubles.iter().flat_map(|&eight| (f64::from_ne_bytes(eight) as f32).to_ne_bytes()).collect();
    }
    Ok(header.picture(Layout::Interleaved, pixels))
}

/// Reads the header of a file on disk; `None` where its rows are not in one piece.
pub(crate) fn npy_open_rows(mut file: File, limits: &Limits) -> Result<Option<Streamed>, Fault> {
    // A header in the newer versions may be longer, but no image's is.
    let beginning = beginning(&mut file, 1 << 17)?;
    let (header, array) = npy_shape(&beginning, limits, Extent::Rows)?;
    if array.fortran {
        return Ok(None);
    }
    let first = (beginning.len() - array.rest.len()) as u64;
    let Array { element, big_endian, .. } = array;
    Strided::open(file, header, Order::Down { first }, Number { bytes: element.bytes(), big_endian, double: element == Element::F64 })
        .map(Some)
}

fn beginning(file: &mut File, most: u64) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    file.take(most).read_to_end(&mut bytes).map_err(Fault::Read)?;
    Ok(bytes)
}

/// The header of a picture like this one, whose top row follows it.
pub(crate) fn npy_head(like: &Picture) -> Vec<u8> {
    let (width, height, count) = (like.width as usize, like.height as usize, like.channels.count());
    let shape = if count == 1 { vec![height, width] } else { vec![height, width, count] };
    npy::header(element(like.sample), &shape)
}

/// Pixels as they stand in the file.
pub(crate) fn npy_rows(sample: Sample, bytes: &[u8]) -> Vec<u8> {
    npy::to_little_endian(element(sample), bytes)
}

fn element(sample: Sample) -> Element {
    match sample {
        Sample::U8 => Element::U8,
        Sample::U16 => Element::U16,
        Sample::F16 => Element::F16,
        Sample::F32 => Element::F32,
    }
}

pub(crate) fn npy_encode(out: &mut dyn Write, picture: &Picture) -> Result<(), Fault> {
    out.write_all(&npy_head(picture)).map_err(Fault::Io)?;
    out.write_all(&npy_rows(picture.sample, &picture.bytes)).map_err(Fault::Io)
}
