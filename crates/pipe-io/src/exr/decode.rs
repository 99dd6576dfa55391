//! Blocks of a file → planes of the display window.
//!
//! The unit of parallel work is a band: one scan-line block, or one row of tiles. Bands cover disjoint rows of every
//! plane, so each thread owns its slices and decoded lines are copied once, from the block to their final place.
//! Bands outside the display window are never decompressed.

use std::ops::Range;

use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates};
use exr::math::Vec2;
use exr::meta::attribute::ChannelDescription;
use exr::meta::header::Header as Part;
use exr::meta::{BlockDescription, MetaData};
use exr::prelude::{Compression, SampleType};
use rayon::prelude::*;

use super::{Opened, fault};
use crate::error::Fault;
use crate::guard::shielded;
use crate::picture::{Sample, Window};

/// Reads `channels` (indices into the part's; `None` reads as zeros) as planes one after another. Each plane covers
/// `view`, in the file's coordinates, divided by its channel's sampling; outside the data window it is zero.
pub(super) fn read(opened: &Opened, bytes: &[u8], channels: &[Option<usize>], sample: Sample, view: Window) -> Result<Vec<u8>, Fault> {
    let part = opened.part();
    let planes: Vec<Plane> = channels.iter().map(|&index| Plane::new(part, index, sample, view)).collect();
    let total = planes.iter().map(Plane::bytes).sum();
    // Zeroed pages come from the system untouched, so a file that lies about its size (within the limits) costs no
    // memory until its blocks really arrive.
    let mut pixels = vec![0; total];

    let grid = Grid::new(opened, part);
    let offsets = grid.offsets(opened, bytes)?;
    let bands = split(&grid, &planes, &mut pixels, opened.data, view);
    bands.into_par_iter().try_for_each(|band| shielded(|| band.decode(opened, bytes, &grid, &offsets, &planes, sample, view)))?;
    Ok(pixels)
}

/// How one channel lies in its plane.
struct Plane {
    channel: Option<usize>,
    sampling: (usize, usize),
    /// Samples a row, and rows.
    size: (usize, usize),
    sample: Sample,
}

impl Plane {
    fn new(part: &Part, channel: Option<usize>, sample: Sample, view: Window) -> Self {
        let Vec2(sx, sy) = channel.map_or(Vec2(1, 1), |index| part.channels.list[index].sampling);
        let size = ((view.width as usize).div_ceil(sx), (view.height as usize).div_ceil(sy));
        Self { channel, sampling: (sx, sy), size, sample }
    }

    fn row_bytes(&self) -> usize {
        self.size.0 * self.sample.bytes()
    }

    fn bytes(&self) -> usize {
        self.row_bytes() * self.size.1
    }
}

/// The blocks of the full-resolution level.
struct Grid {
    /// Pixels of a whole block.
    block: (usize, usize),
    /// Blocks across and down.
    count: (usize, usize),
    tiled: bool,
    /// Whether each chunk begins with the number of its part.
    numbered: bool,
}

impl Grid {
    fn new(opened: &Opened, part: &Part) -> Self {
        let (width, height) = (opened.data.width as usize, opened.data.height as usize);
        let (block, tiled) = match part.blocks {
            BlockDescription::Tiles(tiles) => ((tiles.tile_size.0, tiles.tile_size.1), true),
            BlockDescription::ScanLines => ((width, part.compression.scan_lines_per_block()), false),
        };
        let count = (width.div_ceil(block.0), height.div_ceil(block.1));
        Self { block, count, tiled, numbered: opened.meta.requirements.is_multilayer() }
    }

    /// The file offsets of the blocks, row by row. The full-resolution level comes first in every table, whatever
    /// other levels follow.
    fn offsets(&self, opened: &Opened, bytes: &[u8]) -> Result<Vec<usize>, Fault> {
        let count = self.count.0 * self.count.1;
        let table = bytes
            .get(opened.table..)
            .and_then(|rest| rest.get(..count.checked_mul(8)?))
            .ok_or_else(|| Fault::damaged("it ends within its table of blocks"))?;
        let offsets = table.as_chunks::<8>().0.iter().map(|&eight| {
            usize::try_from(u64::from_le_bytes(eight))
                .ok()
                .filter(|&offset| offset >= opened.table && offset < bytes.len())
                .ok_or_else(|| Fault::damaged("blocks are missing: writing it was interrupted, or it was cut off"))
        });
        offsets.collect()
    }

    /// Columns and rows of a block, relative to the data window.
    fn area(&self, opened: &Opened, column: usize, row: usize) -> (Range<usize>, Range<usize>) {
        let (width, height) = (opened.data.width as usize, opened.data.height as usize);
        let (x, y) = (column * self.block.0, row * self.block.1);
        (x..(x + self.block.0).min(width), y..(y + self.block.1).min(height))
    }

    /// Cuts one chunk out of the file and checks that it is the one the table promised.
    fn chunk(&self, opened: &Opened, bytes: &[u8], at: usize, column: usize, row: usize) -> Result<Chunk, Fault> {
        let short = || Fault::damaged("a block runs past the end of the file");
        let mut rest = &bytes[at..];
        let mut int = || {
            let (four, tail) = rest.split_first_chunk::<4>().ok_or_else(short)?;
            rest = tail;
            Ok::<i32, Fault>(i32::from_le_bytes(*four))
        };
        let wrong = || Fault::damaged("its table of blocks points to the wrong places");
        if self.numbered && int()? as usize != opened.layer.part {
            return Err(wrong());
        }
        if self.tiled {
            let place = [int()?, int()?, int()?, int()?];
            if place != [column as i32, row as i32, 0, 0] {
                return Err(wrong());
            }
        } else if i64::from(int()?) != i64::from(opened.data.y) + (row * self.block.1) as i64 {
            return Err(wrong());
        }
        let length = usize::try_from(int()?).map_err(|_| short())?;
        let compressed = rest.get(..length).ok_or_else(short)?.to_vec();
        let compressed_block = if self.tiled {
            let coordinates = TileCoordinates { tile_index: Vec2(column, row), level_index: Vec2(0, 0) };
            CompressedBlock::Tile(CompressedTileBlock { coordinates, compressed_pixels_le: compressed })
        } else {
            let y_coordinate = opened.data.y + (row * self.block.1) as i32;
            CompressedBlock::ScanLine(CompressedScanLineBlock { y_coordinate, compressed_pixels_le: compressed })
        };
        Ok(Chunk { layer_index: opened.layer.part, compressed_block })
    }
}

/// One row of blocks and the rows of every plane that it fills.
struct Band<'a> {
    row: usize,
    /// For each plane: its first row here, and the bytes of its rows.
    rows: Vec<(usize, &'a mut [u8])>,
}

fn split<'a>(grid: &Grid, planes: &[Plane], pixels: &'a mut [u8], data: Window, view: Window) -> Vec<Band<'a>> {
    let mut rest: Vec<(usize, &mut [u8])> = Vec::new();
    let mut remaining = pixels;
    for plane in planes {
        let (own, tail) = remaining.split_at_mut(plane.bytes());
        rest.push((0, own));
        remaining = tail;
    }
    let shift = i64::from(data.y) - i64::from(view.y);
    let mut bands = Vec::new();
    for row in 0..grid.count.1 {
        let clamp = |y: usize| (y as i64 + shift).clamp(0, i64::from(view.height)) as usize;
        let end = ((row + 1) * grid.block.1).min(data.height as usize);
        let seen = clamp(row * grid.block.1)..clamp(end);
        let mut rows = Vec::new();
        for (plane, (next, bytes)) in planes.iter().zip(&mut rest) {
            let own = seen.start.div_ceil(plane.sampling.1)..seen.end.div_ceil(plane.sampling.1);
            let before = (own.start - *next) * plane.row_bytes();
            let length = own.len() * plane.row_bytes();
            let (taken, tail) = std::mem::take(bytes)[..].split_at_mut(before + length);
            *bytes = tail;
            *next = own.end;
            rows.push((own.start, &mut taken[before..]));
        }
        if !seen.is_empty() {
            bands.push(Band { row, rows });
        }
    }
    bands
}

impl Band<'_> {
    #[allow(clippy::too_many_arguments)] // one call, and each argument is a plain part of the picture of the work
    fn decode(
        mut self,
        opened: &Opened,
        bytes: &[u8],
        grid: &Grid,
        offsets: &[usize],
        planes: &[Plane],
        sample: Sample,
        view: Window,
    ) -> Result<(), Fault> {
        let part = opened.part();
        let shift_x = i64::from(opened.data.x) - i64::from(view.x);
        let shift_y = i64::from(opened.data.y) - i64::from(view.y);
        for column in 0..grid.count.0 {
            let (xs, ys) = grid.area(opened, column, self.row);
            let visible = (xs.start as i64 + shift_x).max(0)..(xs.end as i64 + shift_x).min(i64::from(view.width));
            if visible.is_empty() {
                continue;
            }
            let chunk = grid.chunk(opened, bytes, offsets[self.row * grid.count.0 + column], column, self.row)?;
            let block = decompress(&opened.meta, part, chunk, xs.len(), ys.clone())?;
            let mut at = 0;
            for y in ys {
                for (index, channel) in part.channels.list.iter().enumerate() {
                    let Some(length) = line_bytes(channel, xs.len(), y) else { continue };
                    let line = block.get(at..at + length).ok_or_else(|| Fault::damaged("a block is too short"))?;
                    at += length;
                    let target_y = y as i64 + shift_y;
                    if target_y < 0 || target_y >= i64::from(view.height) {
                        continue;
                    }
                    for (plane, (first, rows)) in planes.iter().zip(&mut self.rows) {
                        if plane.channel != Some(index) {
                            continue;
                        }
                        let (sx, sy) = plane.sampling;
                        let row = target_y as usize / sy - *first;
                        let skipped = (visible.start - shift_x) as usize - xs.start;
                        let size = channel.sample_type.bytes_per_sample();
                        let from = skipped / sx * size;
                        let samples = ((visible.end - visible.start) as usize).div_ceil(sx);
                        let to = (row * plane.size.0 + visible.start as usize / sx) * sample.bytes();
                        let target = &mut rows[to..to + samples * sample.bytes()];
                        copy(&line[from..from + samples * size], channel.sample_type, target, sample);
                    }
                }
            }
        }
        Ok(())
    }
}

/// Bytes of a line of a channel within a block; `None` where subsampling leaves the line out.
fn line_bytes(channel: &ChannelDescription, width: usize, y: usize) -> Option<usize> {
    let Vec2(sx, sy) = channel.sampling;
    y.is_multiple_of(sy).then(|| width.div_ceil(sx) * channel.sample_type.bytes_per_sample())
}

fn copy(line: &[u8], from: SampleType, target: &mut [u8], to: Sample) {
    let wide = target.as_chunks_mut::<4>().0;
    match (from, to) {
        (SampleType::F16, Sample::F16) | (SampleType::F32, Sample::F32) => target.copy_from_slice(line),
        (SampleType::F16, _) => {
            for (value, out) in line.as_chunks::<2>().0.iter().zip(wide) {
                *out = half::f16::from_ne_bytes(*value).to_f32().to_ne_bytes();
            }
        }
        (SampleType::U32, _) => {
            for (value, out) in line.as_chunks::<4>().0.iter().zip(wide) {
                *out = (u32::from_ne_bytes(*value) as f32).to_ne_bytes();
            }
        }
        (SampleType::F32, _) => {
            for (value, out) in line.as_chunks::<4>().0.iter().zip(wide) {
                *out = *value;
            }
        }
    }
}

/// Decompresses one block of `width` columns and the rows `ys`.
fn decompress(meta: &MetaData, part: &Part, chunk: Chunk, width: usize, ys: Range<usize>) -> Result<Vec<u8>, Fault> {
    if let (Compression::DWAA(_) | Compression::DWAB(_), Some(packed)) = (part.compression, packed_bytes(&chunk)) {
        let padded = (width + 7) * (ys.len() + 7) * part.channels.bytes_per_pixel;
        check_dwa_counters(packed, width * ys.len() * part.channels.bytes_per_pixel, padded)?;
    }
    if part.channels.list.iter().all(|channel| channel.sampling == Vec2(1, 1)) {
        return Ok(UncompressedBlock::decompress_chunk(chunk, meta, false).map_err(fault)?.data);
    }
    decompress_subsampled(part, chunk, width, ys)
}

fn packed_bytes(chunk: &Chunk) -> Option<&[u8]> {
    match &chunk.compressed_block {
        CompressedBlock::Tile(block) => Some(&block.compressed_pixels_le),
        CompressedBlock::ScanLine(block) => Some(&block.compressed_pixels_le),
        _ => None,
    }
}

/// A DWA block begins with the sizes of its sections, which the `exr` crate allocates without a second look: one
/// changed byte asks for an exabyte and aborts the process. `raw` is the size of the block when stored uncompressed
/// (it has no such header then), `padded` that of its 8×8 blocks.
fn check_dwa_counters(packed: &[u8], raw: usize, padded: usize) -> Result<(), Fault> {
    if packed.len() == raw {
        return Ok(());
    }
    let counters = packed.get(..88).ok_or_else(|| Fault::damaged("a block is too short"))?.as_chunks::<8>().0;
    // By index: 1, 6, 7 sizes of unpacked sections (run lengths may expand a little); 8, 9 counts of u16;
    // 2 to 5 sizes of packed sections.
    let largest = |index: usize| if (2..=5).contains(&index) { packed.len() } else { 2 * padded + 1024 };
    let plausible = (1..10).all(|index| u64::from_le_bytes(counters[index]) <= largest(index) as u64);
    if plausible { Ok(()) } else { Err(Fault::damaged("a block declares sections larger than itself")) }
}

/// The `exr` crate reads subsampled headers and its codecs handle subsampled channels, but its block level computes
/// the size of a block as though there were none. So the block is given to it as a file of its own, whose header
/// declares the true number of bytes: for codecs that see only bytes, as one row of half samples; for those that see
/// channels, with the number of bytes a pixel corrected to the (whole) average.
fn decompress_subsampled(part: &Part, chunk: Chunk, width: usize, ys: Range<usize>) -> Result<Vec<u8>, Fault> {
    let CompressedBlock::ScanLine(block) = chunk.compressed_block else {
        return Err(Fault::damaged("its tiles have subsampled channels, which EXR forbids"));
    };
    let list = &part.channels.list;
    let size: usize = ys.clone().flat_map(|y| list.iter().filter_map(move |channel| line_bytes(channel, width, y))).sum();
    let height = ys.len();
    let bytewise = matches!(part.compression, Compression::Uncompressed | Compression::RLE | Compression::ZIP1 | Compression::ZIP16);
    let mut alone = part.clone();
    alone.own_attributes.layer_position = Vec2(0, 0);
    if bytewise {
        alone.channels = exr::meta::attribute::ChannelList::new(std::iter::once(ChannelDescription::named("Y", SampleType::F16)).collect());
        alone.layer_size = Vec2(size / 2, 1);
    } else {
        let divisible = list.iter().all(|channel| width.is_multiple_of(channel.sampling.0) && ys.start.is_multiple_of(channel.sampling.1));
        if !divisible || !size.is_multiple_of(width * height) {
            return Err(Fault::unsupported("chroma subsampling of this kind; save it as RGB"));
        }
        alone.channels.bytes_per_pixel = size / (width * height);
        alone.layer_size = Vec2(width, height);
    }
    alone.chunk_count = 1;
    let header = alone.clone();
    let area = exr::prelude::IntegerBounds { position: Vec2(0, 0), size: header.layer_size };
    (header.compression).decompress_image_section_from_le(&alone, block.compressed_pixels_le, area, false).map_err(fault)
}
