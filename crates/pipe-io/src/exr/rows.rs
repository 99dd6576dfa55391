//! A band of rows of a file that stays on disk: only the blocks that touch it are read and decoded.

use std::fs::File;
use std::io::BufReader;
use std::ops::Range;

use super::Opened;
use super::decode::{Blocks, Planes, Stripe, block_size};
use super::layer::Meaning;
use crate::error::Fault;
use crate::picture::{Layout, Sample, Window};
use crate::rows::{Kept, Rows, Streamed, zeroed};
use crate::source::{Extent, Limits};
use crate::store::{FileStore, Store};

/// Reads the header and the table of blocks; `None` where a band cannot be decoded alone (subsampled chroma, whose
/// filter reaches over rows).
pub(crate) fn open(file: File, layer: Option<&str>, limits: &Limits) -> Result<Option<Streamed>, Fault> {
    let mut reader = BufReader::new(file.try_clone().map_err(Fault::Read)?);
    let store = FileStore::new(file).map_err(Fault::Read)?;
    let opened = Opened::parse(&mut reader, store.length(), layer, limits, Extent::Rows)?;
    if opened.layer.meaning == Meaning::LuminanceChroma {
        return Ok(None);
    }
    let header = opened.describe();
    // One row of blocks is decoded at once, whatever is asked for.
    let (data, block) = (opened.data, block_size(&opened).0.1 as u64);
    let all_channels = opened.part().channels.bytes_per_pixel.max(header.channels.count() * header.sample.bytes()) as u64;
    limits.check(data.width.max(header.width).into(), block.min(data.height.into()), all_channels)?;
    let blocks = Blocks::locate(&opened, &store)?;
    let rows = ExrRows { opened, store, blocks, sample: header.sample, kept: Kept::default() };
    Ok(Some(Streamed { header, layout: Layout::Planar, profile: None, rows: Box::new(rows) }))
}

struct ExrRows {
    opened: Opened,
    store: FileStore,
    blocks: Blocks,
    sample: Sample,
    /// The last row of blocks that was decoded: the next band will most likely begin in it.
    kept: Kept,
}

impl ExrRows {
    /// A window of these rows.
    fn planes(&self, rows: &Range<usize>) -> Planes {
        let display = self.opened.display;
        let view = Window { y: display.y + rows.start as i32, height: rows.len() as u32, ..display };
        Planes::new(self.opened.part(), &self.opened.layer.channels, self.sample, view)
    }

    /// The rows that are decoded together with this one; none outside the data window.
    fn around(&self, row: usize) -> Range<usize> {
        let Opened { data, display, .. } = self.opened;
        let shift = i64::from(data.y) - i64::from(display.y);
        let inside = row as i64 - shift;
        if inside < 0 || inside >= i64::from(data.height) {
            return row + 1..row + 1;
        }
        let rows = self.blocks.around(inside as usize, data);
        let clamp = |y: usize| (y as i64 + shift).clamp(0, i64::from(display.height)) as usize;
        clamp(rows.start)..clamp(rows.end)
    }
}

impl Rows for ExrRows {
    fn read(&mut self, rows: Range<usize>, into: &mut [u8]) -> Result<(), Fault> {
        let plane_row = self.opened.display.width as usize * self.sample.bytes();
        let rest = self.kept.copy_beginning(&rows, plane_row, into);
        if rest.is_empty() {
            return Ok(());
        }
        let last = self.around(rest.end - 1);
        let (all, tail) = (self.planes(&rows), self.planes(&last));
        let mut pixels = zeroed(self.kept.take(), tail.bytes());
        let direct = rest.start - rows.start..last.start.max(rest.start) - rows.start;
        let stripes = vec![
            Stripe { planes: &all, rows: direct, pixels: &mut *into },
            Stripe { planes: &tail, rows: 0..last.len(), pixels: &mut pixels },
        ];
        self.blocks.decode(&self.opened, &self.store, stripes)?;
        self.kept = Kept::new(last.clone(), pixels);
        self.kept.copy(last.start.max(rest.start)..rest.end, &rows, plane_row, into);
        Ok(())
    }
}
