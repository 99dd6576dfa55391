//! A band of rows of a file that stays on disk: strip by strip, or one row of tiles after the other.

use std::fs::File;
use std::io::BufReader;
use std::ops::Range;

use tiff::ColorType;
use tiff::decoder::{ChunkType, Decoder};
use tiff::tags::Tag;

use super::{Opened, fault, samples};
use crate::error::Fault;
use crate::picture::{Header, Layout};
use crate::raster;
use crate::rows::{Kept, Number, Order, Rows, Streamed, Strided, zeroed};
use crate::source::{Extent, Limits};

/// Reads the header and the places of the strips or tiles; `None` where the picture has to be turned.
pub(crate) fn open(file: File, limits: &Limits, profiles: bool) -> Result<Option<Streamed>, Fault> {
    let length = file.metadata().map_err(Fault::Read)?.len();
    let unbuffered = file.try_clone().map_err(Fault::Read)?;
    let mut opened = super::open(BufReader::new(file), limits, Extent::Rows)?;
    if raster::exif_orientation(opened.orientation).is_some() {
        return Ok(None);
    }
    let profile = opened.profile.take().filter(|_| profiles);
    let header = opened.header.clone();
    if let Some((first, number)) = uncompressed(&mut opened) {
        let streamed = Strided::open(unbuffered, header, Order::Down { first }, number)?;
        return Ok(Some(Streamed { profile, ..streamed }));
    }
    let (_, rows) = opened.decoder.chunk_dimensions();
    let block = rows.min(header.height);
    if block == 0 {
        return Err(Fault::damaged("its strips have no rows"));
    }
    let bits = header.channels.count() as u64 * u64::from(opened.kind.bit_depth());
    limits.check(header.width.into(), block.into(), bits.div_ceil(8))?;
    let raw = u128::from(header.width) * u128::from(block) * u128::from(bits) / 8;
    let ratio = header.metadata.compression.as_deref().and_then(largest_ratio);
    if ratio.is_some_and(|ratio| raw > u128::from(length) * ratio) {
        return Err(Fault::damaged(format!("{length} bytes cannot hold the {raw} bytes of pixels it declares")));
    }
    let Opened { decoder, kind, layout, .. } = opened;
    let rows = TiffRows { decoder, header: header.clone(), kind, planes: layout.planes, block: block as usize, kept: Kept::default() };
    Ok(Some(Streamed { header, layout: Layout::Interleaved, profile, rows: Box::new(rows) }))
}

/// How many bytes of pixels one byte of a file can stand for at most; `None` where there is no useful bound.
fn largest_ratio(compression: &str) -> Option<u128> {
    match compression {
        "none" => Some(1),
        "packbits" => Some(64),
        "deflate" => Some(1400),
        // Codes of 12 bits for strings of at most 4096 bytes.
        "lzw" => Some(2800),
        _ => None,
    }
}

/// Where the pixels begin, and how they lie, if they are all in one piece. Many programs write one strip, which to
/// decode like any other would mean to hold the picture.
fn uncompressed(opened: &mut Opened<BufReader<File>>) -> Option<(u64, Number)> {
    let Opened { decoder, header, kind, layout, .. } = opened;
    let tag = |decoder: &mut Decoder<_>, tag| decoder.find_tag_unsigned::<u16>(tag).ok().flatten();
    let upright = matches!(tag(decoder, Tag::PhotometricInterpretation), Some(1 | 2));
    let plain = matches!(tag(decoder, Tag::Predictor), None | Some(1)) && header.metadata.compression.as_deref() == Some("none");
    let all = tag(decoder, Tag::SamplesPerPixel).unwrap_or(1) as usize == header.channels.count();
    let bits = kind.bit_depth();
    if !upright || !plain || !all || layout.planes > 1 || bits % 8 != 0 || decoder.get_chunk_type() != ChunkType::Strip {
        return None;
    }
    let bytes = usize::from(bits / 8);
    let row = header.width as u64 * (header.channels.count() * bytes) as u64;
    let (_, rows) = decoder.chunk_dimensions();
    let offsets = decoder.get_tag_u64_vec(Tag::StripOffsets).ok()?;
    let first = *offsets.first()?;
    let strip = row.checked_mul(u64::from(rows.min(header.height)))?;
    let adjoining =
        offsets.iter().zip(0..).all(|(&offset, index)| strip.checked_mul(index).and_then(|at| at.checked_add(first)) == Some(offset));
    let complete = offsets.len() as u64 >= u64::from(header.height.div_ceil(rows.max(1)));
    let big_endian = decoder.byte_order() == tiff::tags::ByteOrder::BigEndian;
    (adjoining && complete).then_some((first, Number { bytes, big_endian, double: bits == 64 }))
}

struct TiffRows {
    decoder: Decoder<BufReader<File>>,
    header: Header,
    kind: ColorType,
    /// More than one where each channel has its own strips or tiles.
    planes: usize,
    /// Rows of a strip or tile.
    block: usize,
    /// The last rows that were decoded: the next band will most likely begin in them.
    kept: Kept,
}

impl TiffRows {
    /// Decodes a strip, or a row of tiles.
    fn decode(&mut self, index: usize) -> Result<(), Fault> {
        let (width, height) = (self.header.width as usize, self.header.height as usize);
        let (sample, channels) = (self.header.sample.bytes(), self.header.channels.count());
        let pixel = sample * channels;
        let rows = index * self.block..((index + 1) * self.block).min(height);
        let across = width.div_ceil(self.decoder.chunk_dimensions().0 as usize);
        let down = height.div_ceil(self.block);
        let mut bytes = zeroed(self.kept.take(), rows.len() * width * pixel);
        for (plane, column) in (0..self.planes).flat_map(|plane| (0..across).map(move |column| (plane, column))) {
            let chunk = ((plane * down + index) * across + column) as u32;
            let decoded = self.decoder.read_chunk(chunk).map_err(fault)?;
            let size = self.decoder.chunk_data_dimensions(chunk);
            let (w, h) = (size.0 as usize, size.1 as usize);
            let values = samples(decoded, self.kind, w, h)?;
            let x = column * self.decoder.chunk_dimensions().0 as usize;
            let from = if self.planes > 1 { sample } else { pixel };
            if values.len() != w * h * from || h != rows.len() || x + w > width {
                return Err(Fault::damaged("its pixels do not fill its size"));
            }
            for (line, out) in values.chunks_exact(w * from).zip(bytes.chunks_exact_mut(width * pixel)) {
                let out = &mut out[x * pixel..(x + w) * pixel];
                if self.planes == 1 {
                    out.copy_from_slice(line);
                } else {
                    let targets = out.chunks_exact_mut(pixel).map(|pixel| &mut pixel[plane * sample..(plane + 1) * sample]);
                    targets.zip(line.chunks_exact(sample)).for_each(|(target, value)| target.copy_from_slice(value));
                }
            }
        }
        self.kept = Kept::new(rows, bytes);
        Ok(())
    }
}

impl Rows for TiffRows {
    fn read(&mut self, rows: Range<usize>, into: &mut [u8]) -> Result<(), Fault> {
        let row = self.header.width as usize * self.header.channels.count() * self.header.sample.bytes();
        let mut rest = rows.clone();
        while !rest.is_empty() {
            if !self.kept.rows().contains(&rest.start) {
                self.decode(rest.start / self.block)?;
            }
            let end = rest.end.min(self.kept.rows().end);
            self.kept.copy(rest.start..end, &rows, row, into);
            rest.start = end;
        }
        Ok(())
    }
}
