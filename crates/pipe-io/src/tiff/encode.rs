//! Rows → strips of a file, from top to bottom; the directory follows them.
//!
//! The `tiff` crate's encoder borrows itself for as long as an image is written, so that it cannot be kept between
//! bands, and compresses on one thread. So this module takes the compressions from it and writes the directory itself:
//! fifteen entries. A file that might pass 4 GiB is a BigTIFF, where every offset has eight bytes.

use std::io::{Seek, SeekFrom, Write};

use rayon::prelude::*;
use tiff::encoder::compression::{CompressionAlgorithm, Deflate, Lzw, Packbits};

use crate::error::Fault;
use crate::form::Compression;
use crate::picture::{Alpha, Picture, Sample};

/// Bytes of a strip before compression, about.
const STRIP: usize = 1_000_000;
/// Strips that are compressed before they are written.
const AT_ONCE: usize = 64;

/// Writes a picture at once.
pub(crate) fn encode(out: &mut (impl Write + Seek), picture: &Picture, compression: Compression) -> Result<(), Fault> {
    let mut strips = Strips::begin(out, picture, compression)?;
    strips.write(&picture.bytes)?;
    strips.finish().map(drop)
}

/// A file whose rows are being written.
pub(crate) struct Strips<W> {
    out: W,
    /// The picture, without its pixels.
    like: Picture,
    compression: Compression,
    /// Whether offsets have eight bytes.
    big: bool,
    rows_per_strip: usize,
    /// Bytes of a whole strip before compression.
    strip: usize,
    /// The beginning of the next strip.
    pending: Vec<u8>,
    /// Where each strip is, and how many bytes it has.
    places: Vec<(u64, u64)>,
    /// Bytes written.
    at: u64,
}

impl<W: Write + Seek> Strips<W> {
    /// Begins a file for a picture like this one, whose bytes are not looked at.
    pub(crate) fn begin(out: W, like: &Picture, compression: Compression) -> Result<Self, Fault> {
        let raw = like.width as u64 * u64::from(like.height) * (like.channels.count() * like.sample.bytes()) as u64;
        // LZW makes noise half as large again; 16 bytes are a strip's entries in the directory.
        let most = raw + raw / 2 + u64::from(like.height) * 16 + 4096;
        Self::begin_as(most > u64::from(u32::MAX), out, like, compression)
    }

    /// The same, as a BigTIFF or not.
    fn begin_as(big: bool, out: W, like: &Picture, compression: Compression) -> Result<Self, Fault> {
        if like.sample == Sample::F16 {
            return Err(Fault::Form("TIFF holds u8, u16 or float, not half".to_owned()));
        }
        let row = like.width as usize * like.channels.count() * like.sample.bytes();
        // Runs of PackBits end with their row.
        let rows_per_strip = if compression == Compression::Packbits { 1 } else { STRIP.div_ceil(row) };
        let like = Picture { bytes: Vec::new(), metadata: crate::picture::Metadata::default(), ..*like };
        let strip = row * rows_per_strip;
        let mut strips = Self { out, like, compression, big, rows_per_strip, strip, pending: Vec::new(), places: Vec::new(), at: 0 };
        strips.put(if cfg!(target_endian = "big") { b"MM" } else { b"II" })?;
        if big {
            strips.put(&[43_u16, 8, 0].map(u16::to_ne_bytes).concat())?;
        } else {
            strips.put(&42_u16.to_ne_bytes())?;
        }
        // Where the directory is, which is known at the end.
        let nowhere = strips.offset(0);
        strips.put(&nowhere)?;
        Ok(strips)
    }

    /// Appends rows.
    pub(crate) fn write(&mut self, mut band: &[u8]) -> Result<(), Fault> {
        if !self.pending.is_empty() {
            let (first, rest) = band.split_at(band.len().min(self.strip - self.pending.len()));
            self.pending.extend_from_slice(first);
            band = rest;
            if self.pending.len() < self.strip {
                return Ok(());
            }
            let strip = std::mem::take(&mut self.pending);
            self.strips(&strip)?;
        }
        let whole = band.len() - band.len() % self.strip;
        self.strips(&band[..whole])?;
        self.pending.extend_from_slice(&band[whole..]);
        Ok(())
    }

    /// Writes whole strips, the last of the picture among them.
    fn strips(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        if self.compression == Compression::None {
            return bytes.chunks(self.strip).try_for_each(|strip| self.strip(strip));
        }
        for strips in bytes.chunks(self.strip * AT_ONCE) {
            let compression = self.compression;
            let packed: Vec<_> = strips.par_chunks(self.strip).map(|strip| compress(strip, compression)).collect::<Result<_, _>>()?;
            packed.iter().try_for_each(|strip| self.strip(strip))?;
        }
        Ok(())
    }

    fn strip(&mut self, packed: &[u8]) -> Result<(), Fault> {
        self.places.push((self.at, packed.len() as u64));
        self.put(packed)
    }

    /// Writes what is left and the directory.
    pub(crate) fn finish(mut self) -> Result<W, Fault> {
        let last = std::mem::take(&mut self.pending);
        self.strips(&last)?;
        let entries = self.entries();
        let inline = self.offset(0).len();
        let mut fields = Vec::new();
        for (tag, kind, count, value) in &entries {
            let mut field = [tag.to_ne_bytes(), kind.to_ne_bytes()].concat();
            field.extend(self.offset(*count as u64));
            let mut value = value.clone();
            if value.len() > inline {
                self.align()?;
                let at = self.offset(self.at);
                self.put(&value)?;
                value = at;
            }
            value.resize(inline, 0);
            field.extend(value);
            fields.extend(field);
        }
        self.align()?;
        let directory = self.offset(self.at);
        let count = if self.big { (entries.len() as u64).to_ne_bytes().to_vec() } else { (entries.len() as u16).to_ne_bytes().to_vec() };
        let none = self.offset(0);
        self.put(&[count, fields, none].concat())?;
        self.out.seek(SeekFrom::Start(if self.big { 8 } else { 4 })).map_err(Fault::Io)?;
        self.out.write_all(&directory).map_err(Fault::Io)?;
        Ok(self.out)
    }

    /// Tag, type, count and value of everything that TIFF wants to know, by tag.
    fn entries(&self) -> Vec<(u16, u16, usize, Vec<u8>)> {
        const RATIONAL: u16 = 5;
        let Picture { width, height, sample, channels, alpha, .. } = self.like;
        let short = |tag: u16, values: &[u16]| (tag, 3, values.len(), values.iter().flat_map(|value| value.to_ne_bytes()).collect());
        let long = |tag: u16, value: u32| (tag, 4, 1, value.to_ne_bytes().to_vec());
        let places = |tag: u16, value: fn(&(u64, u64)) -> u64| {
            let values = self.places.iter().flat_map(|place| self.offset(value(place))).collect();
            (tag, if self.big { 16 } else { 4 }, self.places.len(), values)
        };
        let one = [1_u32.to_ne_bytes(), 1_u32.to_ne_bytes()].concat();
        let each = |value: u16| vec![value; channels.count()];
        let method = match self.compression {
            Compression::Lzw => 5,
            Compression::Deflate => 8,
            Compression::Packbits => 32773,
            _ => 1,
        };
        let mut entries = vec![
            long(256, width),
            long(257, height),
            short(258, &each(sample.bytes() as u16 * 8)),
            short(259, &[method]),
            short(262, &[if channels.is_grey() { 1 } else { 2 }]),
            places(273, |place| place.0),
            short(277, &[channels.count() as u16]),
            long(278, self.rows_per_strip as u32),
            places(279, |place| place.1),
            (282, RATIONAL, 1, one.clone()),
            (283, RATIONAL, 1, one),
            // No unit: pixels are square, and of no size.
            short(296, &[1]),
            short(317, &[1]),
        ];
        match alpha {
            Alpha::None => {}
            Alpha::Associated => entries.push(short(338, &[1])),
            Alpha::Straight => entries.push(short(338, &[2])),
        }
        entries.push(short(339, &each(if sample.is_float() { 3 } else { 1 })));
        entries
    }

    fn offset(&self, value: u64) -> Vec<u8> {
        if self.big { value.to_ne_bytes().to_vec() } else { (value as u32).to_ne_bytes().to_vec() }
    }

    /// Values and directories begin at even places.
    fn align(&mut self) -> Result<(), Fault> {
        if self.at.is_multiple_of(2) { Ok(()) } else { self.put(&[0]) }
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        self.at += bytes.len() as u64;
        self.out.write_all(bytes).map_err(Fault::Io)
    }
}

fn compress(strip: &[u8], compression: Compression) -> Result<Vec<u8>, Fault> {
    let mut packed = Vec::new();
    match compression {
        Compression::Lzw => Lzw.write_to(&mut packed, strip),
        Compression::Deflate => Deflate::default().write_to(&mut packed, strip),
        _ => Packbits.write_to(&mut packed, strip),
    }
    .map_err(Fault::Io)?;
    Ok(packed)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::colour::Colour;
    use crate::picture::{Channels, Layout, Metadata};
    use crate::source::Limits;

    #[test]
    fn a_big_tiff_holds_the_same() {
        let picture = Picture {
            width: 900,
            height: 1300,
            sample: Sample::U16,
            layout: Layout::Interleaved,
            channels: Channels::Ya,
            alpha: Alpha::Straight,
            colour: Colour::SRGB,
            bytes: (0..900 * 1300 * 4).map(|i: u32| (i.wrapping_mul(i) >> 13) as u8).collect(),
            metadata: Metadata::default(),
        };
        for compression in [Compression::None, Compression::Lzw, Compression::Deflate, Compression::Packbits] {
            for big in [false, true] {
                let mut strips = Strips::begin_as(big, Cursor::new(Vec::new()), &picture, compression).unwrap();
                for band in picture.bytes.chunks(900 * 4 * 111) {
                    strips.write(band).unwrap();
                }
                let file = strips.finish().unwrap().into_inner();
                assert_eq!(file[2], if big { 43 } else { 42 });
                let back = crate::tiff::decode(&file, &Limits::default(), true).unwrap();
                assert!(back.bytes == picture.bytes && back.alpha == Alpha::Straight, "{compression:?}, big: {big}");
            }
        }
    }
}
