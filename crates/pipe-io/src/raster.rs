//! JPEG, WebP, GIF and Radiance HDR, over the `image` crate, and QOI.
//!
//! The `image` crate's generic `DynamicImage` is not used: its decoders fill a byte buffer, which is all a picture is.
//! HDR radiance is divided by the file's `EXPOSURE` here (a header value that hardly any file has).

use std::io::{Cursor, Seek, Write};

use image::codecs::gif::{GifDecoder, GifEncoder};
use image::codecs::hdr::{HdrDecoder, HdrEncoder};
use image::codecs::jpeg::{JpegDecoder, JpegEncoder};
use image::codecs::webp::{WebPDecoder, WebPEncoder};
use image::metadata::Orientation;
use image::{ColorType, ExtendedColorType, ImageDecoder, ImageEncoder, ImageError};

use crate::colour::Colour;
use crate::error::Fault;
use crate::picture::{Alpha, Channels, Header, Layout, Metadata, Picture, Sample};
use crate::source::{Format, Limits};
use crate::{icc, jpeg};

/// Reads the header alone.
pub(crate) fn header(format: Format, bytes: &[u8], limits: &Limits, profiles: bool) -> Result<Header, Fault> {
    match format {
        Format::Jpeg => {
            let mut decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(fault)?;
            let mut header = describe(format, &decoder, limits)?;
            if swaps_sides(decoder.orientation().map_err(fault)?) {
                std::mem::swap(&mut header.width, &mut header.height);
            }
            tagged(header, &mut decoder, profiles)
        }
        Format::WebP => {
            let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(fault)?;
            let header = describe(format, &decoder, limits)?;
            tagged(header, &mut decoder, profiles)
        }
        Format::Gif => describe(format, &GifDecoder::new(Cursor::new(bytes)).map_err(fault)?, limits),
        Format::Hdr => describe(format, &HdrDecoder::new(hdr_bytes(bytes)).map_err(fault)?, limits),
        _ => {
            let found = qoi::decode_header(bytes).map_err(|error| Fault::damaged(error.to_string()))?;
            limits.check(found.width.into(), found.height.into(), 4)?;
            let channels = if found.channels.is_rgba() { Channels::Rgba } else { Channels::Rgb };
            let mut header = bare(format, found.width, found.height, channels, Sample::U8);
            if found.colorspace == qoi::ColorSpace::Linear {
                header.colour = Colour::LINEAR_REC709;
            }
            Ok(header)
        }
    }
}

/// Reads the picture.
pub(crate) fn decode(format: Format, bytes: &[u8], limits: &Limits, profiles: bool) -> Result<Picture, Fault> {
    match format {
        Format::Jpeg => {
            let mut decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(fault)?;
            let header = describe(format, &decoder, limits)?;
            jpeg::check_end(bytes)?;
            let orientation = decoder.orientation().map_err(fault)?;
            let profile = decoder.icc_profile().map_err(fault)?;
            let picture = fill(header, decoder)?;
            icc::apply(profile.as_deref().filter(|_| profiles), orient(picture, orientation))
        }
        Format::WebP => {
            let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(fault)?;
            let header = describe(format, &decoder, limits)?;
            let profile = decoder.icc_profile().map_err(fault)?;
            icc::apply(profile.as_deref().filter(|_| profiles), fill(header, decoder)?)
        }
        Format::Gif => {
            // Of a moving picture the first frame.
            let decoder = GifDecoder::new(Cursor::new(bytes)).map_err(fault)?;
            fill(describe(format, &decoder, limits)?, decoder)
        }
        Format::Hdr => {
            let decoder = HdrDecoder::new(hdr_bytes(bytes)).map_err(fault)?;
            let header = describe(format, &decoder, limits)?;
            let about = decoder.metadata();
            if about.orientation != ((1, 0), (0, 1)) {
                return Err(Fault::unsupported("an orientation other than `-Y height +X width`"));
            }
            let mut picture = fill(header, decoder)?;
            if let Some(exposure) = about.exposure.filter(|&e| e != 1.0 && e.is_normal()) {
                for value in picture.bytes.as_chunks_mut::<4>().0 {
                    *value = (f32::from_ne_bytes(*value) / exposure).to_ne_bytes();
                }
            }
            Ok(picture)
        }
        _ => {
            let header = header(format, bytes, limits, profiles)?;
            let (_, pixels) = qoi::decode_to_vec(bytes).map_err(|error| Fault::damaged(error.to_string()))?;
            Ok(header.picture(Layout::Interleaved, pixels))
        }
    }
}

fn bare(format: Format, width: u32, height: u32, channels: Channels, sample: Sample) -> Header {
    Header {
        format,
        width,
        height,
        sample,
        channels,
        alpha: if channels.has_alpha() { Alpha::Straight } else { Alpha::None },
        colour: if sample.is_float() { Colour::LINEAR_REC709 } else { Colour::SRGB },
        channel_names: Vec::new(),
        layers: Vec::new(),
        metadata: Metadata { sample: Some(sample), had_alpha: channels.has_alpha(), ..Metadata::default() },
    }
}

fn describe(format: Format, decoder: &impl ImageDecoder, limits: &Limits) -> Result<Header, Fault> {
    let (width, height) = decoder.dimensions();
    let (channels, sample) = match decoder.color_type() {
        ColorType::L8 => (Channels::Y, Sample::U8),
        ColorType::La8 => (Channels::Ya, Sample::U8),
        ColorType::Rgb8 => (Channels::Rgb, Sample::U8),
        ColorType::Rgba8 => (Channels::Rgba, Sample::U8),
        ColorType::Rgb32F => (Channels::Rgb, Sample::F32),
        other => return Err(Fault::unsupported(format!("pixels of type {other:?}"))),
    };
    limits.check(width.into(), height.into(), (channels.count() * sample.bytes()) as u64)?;
    Ok(bare(format, width, height, channels, sample))
}

/// Puts what the ICC profile says into the header, so that planning sees what reading will give.
fn tagged(mut header: Header, decoder: &mut impl ImageDecoder, profiles: bool) -> Result<Header, Fault> {
    let profile = decoder.icc_profile().map_err(fault)?;
    header.apply_profile(profile.as_deref().filter(|_| profiles));
    Ok(header)
}

fn fill(header: Header, decoder: impl ImageDecoder) -> Result<Picture, Fault> {
    let mut pixels = vec![0; decoder.total_bytes() as usize];
    decoder.read_image(&mut pixels).map_err(fault)?;
    Ok(header.picture(Layout::Interleaved, pixels))
}

/// Some programs sign `#?RGBE`; the decoder wants the other signature, which differs in nothing but the word.
fn hdr_bytes(bytes: &[u8]) -> impl std::io::Read + '_ {
    use std::io::Read;
    let (signature, rest): (&[u8], &[u8]) = match bytes.strip_prefix(b"#?RGBE") {
        Some(rest) => (b"#?RADIANCE", rest),
        None => (b"", bytes),
    };
    signature.chain(rest)
}

/// Whether turning the picture upright exchanges its width and its height.
pub(crate) const fn swaps_sides(orientation: Orientation) -> bool {
    matches!(orientation, Orientation::Rotate90 | Orientation::Rotate270 | Orientation::Rotate90FlipH | Orientation::Rotate270FlipH)
}

/// The orientation that an Exif or TIFF tag asks for, if it asks for any.
pub(crate) fn exif_orientation(tag: u16) -> Option<Orientation> {
    let orientation = Orientation::from_exif(u8::try_from(tag).ok()?)?;
    (orientation != Orientation::NoTransforms).then_some(orientation)
}

/// Turns a picture upright, as its Exif orientation asks.
pub(crate) fn orient(picture: Picture, orientation: Orientation) -> Picture {
    if orientation == Orientation::NoTransforms {
        return picture;
    }
    let (w, h) = (picture.width as usize, picture.height as usize);
    let size = picture.channels.count() * picture.sample.bytes();
    let (width, height) = if swaps_sides(orientation) { (h, w) } else { (w, h) };
    let mut bytes = Vec::with_capacity(picture.bytes.len());
    for y in 0..height {
        for x in 0..width {
            // Where the upright pixel (x, y) lies in the stored picture.
            let (sx, sy) = match orientation {
                Orientation::NoTransforms => (x, y),
                Orientation::FlipHorizontal => (w - 1 - x, y),
                Orientation::FlipVertical => (x, h - 1 - y),
                Orientation::Rotate180 => (w - 1 - x, h - 1 - y),
                Orientation::Rotate90 => (y, h - 1 - x),
                Orientation::Rotate270 => (w - 1 - y, x),
                Orientation::Rotate90FlipH => (y, x),
                Orientation::Rotate270FlipH => (w - 1 - y, h - 1 - x),
            };
            let at = (sy * w + sx) * size;
            bytes.extend_from_slice(&picture.bytes[at..at + size]);
        }
    }
    Picture { width: width as u32, height: height as u32, bytes, ..picture }
}

/// Writes an 8-bit picture (f32 for HDR) in the form that was asked for.
pub(crate) fn encode(format: Format, out: &mut (impl Write + Seek), picture: &Picture, quality: u8) -> Result<(), Fault> {
    let (width, height) = (picture.width, picture.height);
    let kind = match (picture.channels, picture.sample) {
        (Channels::Y, Sample::U8) => ExtendedColorType::L8,
        (Channels::Ya, Sample::U8) => ExtendedColorType::La8,
        (Channels::Rgb, Sample::U8) => ExtendedColorType::Rgb8,
        (Channels::Rgba, Sample::U8) => ExtendedColorType::Rgba8,
        (Channels::Rgb, Sample::F32) => ExtendedColorType::Rgb32F,
        _ => return Err(Fault::Form(format!("{} cannot hold these pixels", format.name()))),
    };
    match format {
        Format::Jpeg => JpegEncoder::new_with_quality(out, quality).write_image(&picture.bytes, width, height, kind),
        Format::Gif => GifEncoder::new(out).encode(&picture.bytes, width, height, kind),
        Format::WebP => WebPEncoder::new_lossless(out).write_image(&picture.bytes, width, height, kind),
        Format::Hdr => HdrEncoder::new(out).write_image(&representable(&picture.bytes), width, height, kind),
        _ => {
            let mut encoder = qoi::Encoder::new(&picture.bytes, width, height).map_err(|error| Fault::Form(error.to_string()))?;
            if picture.colour == Colour::LINEAR_REC709 {
                encoder = encoder.with_colorspace(qoi::ColorSpace::Linear);
            }
            let bytes = encoder.encode_to_vec().map_err(|error| Fault::Form(error.to_string()))?;
            return out.write_all(&bytes).map_err(Fault::Io);
        }
    }
    .map_err(|error| match error {
        ImageError::IoError(error) => Fault::Io(error),
        other => Fault::Form(other.to_string()),
    })
}

/// RGBE has no sign, no NaN and no infinity (and the encoder overflows on them): they become 0 and its largest value.
fn representable(bytes: &[u8]) -> std::borrow::Cow<'_, [u8]> {
    const LARGEST: f32 = 1.69e38;
    let values = bytes.as_chunks::<4>().0;
    if values.iter().all(|&value| (0.0..=LARGEST).contains(&f32::from_ne_bytes(value))) {
        return bytes.into();
    }
    let nearest = |value: f32| if value > 0.0 { value.min(LARGEST) } else { 0.0 };
    values.iter().flat_map(|&value| nearest(f32::from_ne_bytes(value)).to_ne_bytes()).collect()
}

fn fault(error: ImageError) -> Fault {
    match error {
        ImageError::Unsupported(error) => Fault::unsupported(error),
        ImageError::Limits(error) => Fault::TooLarge(error.to_string()),
        ImageError::IoError(_) => Fault::damaged("it ends too early"),
        other => Fault::damaged(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orientations_turn_the_right_way() {
        // 1 2 3
        // 4 5 6
        let header = bare(Format::Jpeg, 3, 2, Channels::Y, Sample::U8);
        let turned = |orientation| {
            let picture = header.clone().picture(Layout::Interleaved, vec![1, 2, 3, 4, 5, 6]);
            orient(picture, orientation).bytes
        };
        assert_eq!(turned(Orientation::Rotate90), [4, 1, 5, 2, 6, 3]);
        assert_eq!(turned(Orientation::Rotate270), [3, 6, 2, 5, 1, 4]);
        assert_eq!(turned(Orientation::Rotate180), [6, 5, 4, 3, 2, 1]);
        assert_eq!(turned(Orientation::FlipHorizontal), [3, 2, 1, 6, 5, 4]);
        // Exif 5 (transpose) and 7 (transverse).
        assert_eq!(turned(Orientation::Rotate90FlipH), [1, 4, 2, 5, 3, 6]);
        assert_eq!(turned(Orientation::Rotate270FlipH), [6, 3, 5, 2, 4, 1]);
    }
}
