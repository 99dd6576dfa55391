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
use crate::store::Store;

/// Reads `channels` (indices into the part's; `None` reads as zeros) as planes one after another. Each plane covers
/// `view`, in the file's coordinates, divided by its channel's sampling; outside the data window it is zero.
pub(super) fn read(
    opened: &Opened,
    store: &impl Store,
    channels: &[Option<usize>],
    sample: Sample,
    view: Window,
) -> Result<Vec<u8>, Fault> {
    let planes = Planes::new(opened.part(), channels, sample, view);
    // Zeroed pages come from the system untouched, so a file that lies about its size (within the limits) costs no
    // memory until its blocks really arrive.
    let mut pixels = vec![0; planes.bytes()];
    let stripe = Stripe { planes: &planes, rows: 0..view.height as usize, pixels: &mut pixels };
    Blocks::locate(opened, store)?.decode(opened, store, vec![stripe])?;
    Ok(pixels)
}

/// Where channels are decoded to: planes one after another, that cover a window of the file.
pub(super) struct Planes {
    list: Vec<Plane>,
    view: Window,
    sample: Sample,
}

impl Planes {
    pub(super) fn new(part: &Part, channels: &[Option<usize>], sample: Sample, view: Window) -> Self {
        Self { list: channels.iter().map(|&index| Plane::new(part, index, sample, view)).collect(), view, sample }
    }

    pub(super) fn bytes(&self) -> usize {
        self.list.iter().map(Plane::bytes).sum()
    }
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

/// Rows of planes that are to be decoded.
pub(super) struct Stripe<'a> {
    pub(super) planes: &'a Planes,
    /// Which, counted from the top of the planes' view.
    pub(super) rows: Range<usize>,
    /// All planes, not only these rows.
    pub(super) pixels: &'a mut [u8],
}

/// The blocks of the full-resolution level.
pub(super) struct Blocks {
    /// Pixels of a whole block.
    size: (usize, usize),
    /// Blocks across and down.
    count: (usize, usize),
    tiled: bool,
    /// Whether each chunk begins with the number of its part.
    numbered: bool,
    /// Where they are in the file, row by row.
    offsets: Vec<u64>,
}

impl Blocks {
    /// Reads the table of blocks. The full-resolution level comes first in every table, whatever other levels follow.
    pub(super) fn locate(opened: &Opened, store: &impl Store) -> Result<Self, Fault> {
        let (width, height) = (opened.data.width as usize, opened.data.height as usize);
        let (size, tiled) = block_size(opened);
        let count = (width.div_ceil(size.0), height.div_ceil(size.1));
        let short = || Fault::damaged("it ends within its table of blocks");
        let bytes = count.0.checked_mul(count.1).and_then(|blocks| blocks.checked_mul(8)).ok_or_else(short)?;
        let table = store.bytes(opened.table, bytes)?.ok_or_else(short)?;
        let offsets = table.as_chunks::<8>().0.iter().map(|&eight| {
            Some(u64::from_le_bytes(eight))
                .filter(|&offset| offset >= opened.table && offset < store.length())
                .ok_or_else(|| Fault::damaged("blocks are missing: writing it was interrupted, or it was cut off"))
        });
        let offsets = offsets.collect::<Result<_, _>>()?;
        Ok(Self { size, count, tiled, numbered: opened.meta.requirements.is_multilayer(), offsets })
    }

    /// Decodes rows into their planes, which are zero there. No two stripes share a row of blocks, or it is decoded twice.
    pub(super) fn decode(&self, opened: &Opened, store: &impl Store, stripes: Vec<Stripe>) -> Result<(), Fault> {
        let bands: Vec<Band> = stripes.into_iter().flat_map(|stripe| self.split(stripe, opened.data)).collect();
        // With fewer bands than threads, the tiles of each are decompressed at the same time too.
        let at_once = rayon::current_num_threads().div_ceil(bands.len().max(1));
        bands.into_par_iter().try_for_each(|band| shielded(|| band.decode(opened, store, self, at_once)))
    }

    /// The rows of the data window that are decoded together with row `y` of it.
    pub(super) fn around(&self, y: usize, data: Window) -> Range<usize> {
        let start = y - y % self.size.1;
        start..(start + self.size.1).min(data.height as usize)
    }

    /// Columns and rows of a block, relative to the data window.
    fn area(&self, opened: &Opened, column: usize, row: usize) -> (Range<usize>, Range<usize>) {
        let (width, height) = (opened.data.width as usize, opened.data.height as usize);
        let (x, y) = (column * self.size.0, row * self.size.1);
        (x..(x + self.size.0).min(width), y..(y + self.size.1).min(height))
    }

    /// Cuts one chunk out of the file and checks that it is the one the table promised.
    fn chunk(&self, opened: &Opened, store: &impl Store, column: usize, row: usize) -> Result<Chunk, Fault> {
        let short = || Fault::damaged("a block runs past the end of the file");
        let ints = 2 + usize::from(self.numbered) + if self.tiled { 3 } else { 0 };
        let at = self.offsets[row * self.count.0 + column];
        let head = store.bytes(at, ints * 4)?.ok_or_else(short)?;
        let mut rest = head.as_chunks::<4>().0.iter().map(|&four| i32::from_le_bytes(four));
        let mut int = || rest.next().ok_or_else(short);
        let wrong = || Fault::damaged("its table of blocks points to the wrong places");
        if self.numbered && int()? as usize != opened.layer.part {
            return Err(wrong());
        }
        if self.tiled {
            let place = [int()?, int()?, int()?, int()?];
            if place != [column as i32, row as i32, 0, 0] {
                return Err(wrong());
            }
        } else if i64::from(int()?) != i64::from(opened.data.y) + (row * self.size.1) as i64 {
            return Err(wrong());
        }
        let length = usize::try_from(int()?).map_err(|_| short())?;
        let compressed = store.bytes(at + head.len() as u64, length)?.ok_or_else(short)?;
        let compressed_block = if self.tiled {
            let coordinates = TileCoordinates { tile_index: Vec2(column, row), level_index: Vec2(0, 0) };
            CompressedBlock::Tile(CompressedTileBlock { coordinates, compressed_pixels_le: compressed })
        } else {
            let y_coordinate = opened.data.y + (row * self.size.1) as i32;
            CompressedBlock::ScanLine(CompressedScanLineBlock { y_coordinate, compressed_pixels_le: compressed })
        };
        Ok(Chunk { layer_index: opened.layer.part, compressed_block })
    }

    /// Cuts a stripe into bands that can be decoded at the same time.
    fn split<'a>(&self, stripe: Stripe<'a>, data: Window) -> Vec<Band<'a>> {
        let Stripe { planes, rows, pixels } = stripe;
        let mut rest: Vec<(usize, &mut [u8])> = Vec::new();
        let mut remaining = pixels;
        for plane in &planes.list {
            let (own, tail) = remaining.split_at_mut(plane.bytes());
            rest.push((0, own));
            remaining = tail;
        }
        let shift = i64::from(data.y) - i64::from(planes.view.y);
        let clamp = |y: usize| (y as i64 + shift).clamp(rows.start as i64, rows.end as i64) as usize;
        let mut bands = Vec::new();
        for row in 0..self.count.1 {
            let end = ((row + 1) * self.size.1).min(data.height as usize);
            let seen = clamp(row * self.size.1)..clamp(end);
            if seen.is_empty() {
                continue;
            }
            let mut slices = Vec::new();
            for (plane, (next, bytes)) in planes.list.iter().zip(&mut rest) {
                let own = seen.start.div_ceil(plane.sampling.1)..seen.end.div_ceil(plane.sampling.1);
                let before = (own.start - *next) * plane.row_bytes();
                let length = own.len() * plane.row_bytes();
                let (taken, tail) = std::mem::take(bytes)[..].split_at_mut(before + length);
                *bytes = tail;
                *next = own.end;
                slices.push((own.start, &mut taken[before..]));
            }
            bands.push(Band { row, planes, seen, rows: slices });
        }
        bands
    }
}

/// Pixels of a whole block, and whether blocks are tiles.
pub(super) fn block_size(opened: &Opened) -> ((usize, usize), bool) {
    let part = opened.part();
    match part.blocks {
        BlockDescription::Tiles(tiles) => ((tiles.tile_size.0, tiles.tile_size.1), true),
        BlockDescription::ScanLines => ((opened.data.width as usize, part.compression.scan_lines_per_block()), false),
    }
}

/// One row of blocks and the rows of every plane that it fills.
struct Band<'a> {
    row: usize,
    planes: &'a Planes,
    /// The rows of the view that are wanted of it.
    seen: Range<usize>,
    /// For each plane: its first row here, and the bytes of its rows.
    rows: Vec<(usize, &'a mut [u8])>,
}

impl Band<'_> {
    fn decode(mut self, opened: &Opened, store: &impl Store, blocks: &Blocks, at_once: usize) -> Result<(), Fault> {
        let columns: Vec<usize> = (0..blocks.count.0).filter(|&column| !self.visible(opened, blocks, column).is_empty()).collect();
        for some in columns.chunks(at_once) {
            let unpacked = some.par_iter().map(|&column| {
                shielded(|| {
                    let (xs, ys) = blocks.area(opened, column, self.row);
                    let chunk = blocks.chunk(opened, store, column, self.row)?;
                    decompress(&opened.meta, opened.part(), chunk, xs.len(), ys)
                })
            });
            let unpacked = unpacked.collect::<Result<Vec<_>, _>>()?;
            some.iter().zip(unpacked).try_for_each(|(&column, block)| self.place(opened, blocks, column, &block))?;
        }
        Ok(())
    }

    /// The columns of the view that a block fills.
    fn visible(&self, opened: &Opened, blocks: &Blocks, column: usize) -> Range<i64> {
        let shift = i64::from(opened.data.x) - i64::from(self.planes.view.x);
        let (xs, _) = blocks.area(opened, column, self.row);
        (xs.start as i64 + shift).max(0)..(xs.end as i64 + shift).min(i64::from(self.planes.view.width))
    }

    /// Copies the lines of a block to where they belong.
    fn place(&mut self, opened: &Opened, blocks: &Blocks, column: usize, block: &[u8]) -> Result<(), Fault> {
        let visible = self.visible(opened, blocks, column);
        let Planes { list: planes, view, sample } = self.planes;
        let (xs, ys) = blocks.area(opened, column, self.row);
        let shift_x = i64::from(opened.data.x) - i64::from(view.x);
        let shift_y = i64::from(opened.data.y) - i64::from(view.y);
        let mut at = 0;
        for y in ys {
            for (index, channel) in opened.part().channels.list.iter().enumerate() {
                let Some(length) = line_bytes(channel, xs.len(), y) else { continue };
                let line = block.get(at..at + length).ok_or_else(|| Fault::damaged("a block is too short"))?;
                at += length;
                let target_y = y as i64 + shift_y;
                if target_y < self.seen.start as i64 || target_y >= self.seen.end as i64 {
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
                    copy(&line[from..from + samples * size], channel.sample_type, target, *sample);
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
