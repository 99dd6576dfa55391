//! Pictures that are larger than memory, band by band.
//!
//! A band is some full rows of a picture, in exactly the bytes that [`read`](crate::read) gives and
//! [`write`](crate::write) takes for a picture of these rows alone. [`RowReader`] gives out any band at any time, made
//! for what a pipeline does: ascending bands that overlap a little, and then again from the top. [`RowWriter`] takes
//! them from top to bottom.
//!
//! How much is held beside the band depends on the format. EXR, TIFF, PFM and NPY files have an order to their bytes
//! that lets one jump to any row: one row of blocks is held. PNG has not; it is decoded from top to bottom, the rows
//! that the next band will want again are remembered, and going back means beginning anew. Everything else (and
//! interlaced PNG, subsampled chroma, turned TIFF) is decoded whole, once, and has to be within the
//! [limits](crate::Limits) for that.

mod ahead;
mod read;
mod strided;
mod write;

use std::ops::Range;

pub use self::ahead::{ReadAhead, WriteBehind};
pub use self::read::RowReader;
pub(crate) use self::strided::{Number, Order, Strided};
pub use self::write::RowWriter;

use crate::error::Fault;
use crate::picture::{Header, Layout};

/// A decoder that gives out rows in any order.
pub(crate) trait Rows: Send {
    /// Decodes a band. `into` has its size and is zero.
    fn read(&mut self, rows: Range<usize>, into: &mut [u8]) -> Result<(), Fault>;
}

/// A file whose header was read and whose rows can be.
pub(crate) struct Streamed {
    /// What the rows are, before an ICC profile changes them.
    pub(crate) header: Header,
    pub(crate) layout: Layout,
    /// The ICC profile that the values are to be read with.
    pub(crate) profile: Option<Vec<u8>>,
    pub(crate) rows: Box<dyn Rows>,
}

/// Rows that were decoded already, as planes (one of them, where pixels are interleaved) of just these rows.
#[derive(Default)]
pub(crate) struct Kept {
    rows: Range<usize>,
    bytes: Vec<u8>,
}

impl Kept {
    pub(crate) fn new(rows: Range<usize>, bytes: Vec<u8>) -> Self {
        Self { rows, bytes }
    }

    /// Forgets the rows; their memory can be used again.
    pub(crate) fn take(&mut self) -> Vec<u8> {
        std::mem::take(self).bytes
    }

    pub(crate) fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// Copies those of these rows with which the band of `rows` begins, and tells which are left. `row` is the number of
    /// bytes of a row of one plane.
    pub(crate) fn copy_beginning(&self, rows: &Range<usize>, row: usize, into: &mut [u8]) -> Range<usize> {
        if !self.rows.contains(&rows.start) {
            return rows.clone();
        }
        let end = rows.end.min(self.rows.end);
        self.copy(rows.start..end, rows, row, into);
        end..rows.end
    }

    /// Copies rows that are here to their place in the band of `rows`.
    pub(crate) fn copy(&self, wanted: Range<usize>, rows: &Range<usize>, row: usize, into: &mut [u8]) {
        if wanted.is_empty() {
            return;
        }
        let (from, to) = ((wanted.start - self.rows.start) * row, (wanted.start - rows.start) * row);
        let planes = self.bytes.chunks_exact(self.rows.len() * row).zip(into.chunks_exact_mut(rows.len() * row));
        for (plane, target) in planes {
            target[to..to + wanted.len() * row].copy_from_slice(&plane[from..from + wanted.len() * row]);
        }
    }
}

/// A buffer of so many zeros, in the old one's memory where that suffices. New memory comes from the system untouched,
/// so a file that lies about its size costs nothing before its pixels really arrive.
pub(crate) fn zeroed(mut buffer: Vec<u8>, length: usize) -> Vec<u8> {
    if buffer.capacity() < length {
        return vec![0; length];
    }
    buffer.clear();
    buffer.resize(length, 0);
    buffer
}
