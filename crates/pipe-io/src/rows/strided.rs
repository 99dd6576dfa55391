//! Rows that lie uncompressed in a file, each as long as the next.

use std::fs::File;
use std::ops::Range;

use rayon::prelude::*;

use super::{Rows, Streamed};
use crate::error::Fault;
use crate::picture::{Header, Layout};
use crate::store::{FileStore, Store};

/// Rows of numbers, interleaved.
pub(crate) struct Strided {
    store: FileStore,
    order: Order,
    number: Number,
    /// Bytes of a row in the file.
    row: usize,
}

/// Where rows begin.
pub(crate) enum Order {
    /// From the top: the offset of the first.
    Down { first: u64 },
    /// From the bottom: the offset of the last, and the picture's height.
    Up { bottom: u64, height: usize },
}

/// How a number lies in the file.
pub(crate) struct Number {
    pub(crate) bytes: usize,
    pub(crate) big_endian: bool,
    /// Whether it is a double, which becomes a float.
    pub(crate) double: bool,
}

impl Strided {
    /// The rows of the picture that `header` describes, if the file is long enough for them.
    pub(crate) fn open(file: File, header: Header, order: Order, number: Number) -> Result<Streamed, Fault> {
        let store = FileStore::new(file).map_err(Fault::Read)?;
        let row = header.width as usize * header.channels.count() * number.bytes;
        let (Order::Down { first: start } | Order::Up { bottom: start, .. }) = order;
        if u128::from(start) + row as u128 * u128::from(header.height) > u128::from(store.length()) {
            return Err(Fault::damaged("it is shorter than its size says"));
        }
        let rows = Box::new(Self { store, order, number, row });
        Ok(Streamed { header, layout: Layout::Interleaved, profile: None, rows })
    }

    /// The bytes in the file of these rows, which are in one piece.
    fn place(&self, rows: &Range<usize>) -> u64 {
        let row = self.row as u64;
        match self.order {
            Order::Down { first } => first + rows.start as u64 * row,
            Order::Up { bottom, height } => bottom + (height - rows.end) as u64 * row,
        }
    }

    /// Fills `into` with rows as they are in the file, save for their order and that of their bytes.
    fn fill(&self, rows: &Range<usize>, into: &mut [u8]) -> Result<(), Fault> {
        self.store.fill(self.place(rows), into)?;
        if matches!(self.order, Order::Up { .. }) {
            let count = rows.len();
            let (above, below) = into.split_at_mut(count / 2 * self.row);
            let below = below.chunks_exact_mut(self.row).rev();
            above.chunks_exact_mut(self.row).zip(below).for_each(|(above, below)| above.swap_with_slice(below));
        }
        let Number { bytes, big_endian, .. } = self.number;
        if bytes > 1 && big_endian != cfg!(target_endian = "big") {
            into.par_chunks_mut(self.row).for_each(|row| row.chunks_exact_mut(bytes).for_each(<[u8]>::reverse));
        }
        Ok(())
    }
}

impl Rows for Strided {
    fn read(&mut self, rows: Range<usize>, into: &mut [u8]) -> Result<(), Fault> {
        if !self.number.double {
            return self.fill(&rows, into);
        }
        let mut doubles = vec![0; into.len() * 2];
        self.fill(&rows, &mut doubles)?;
        for (float, double) in into.as_chunks_mut::<4>().0.iter_mut().zip(doubles.as_chunks::<8>().0) {
            *float = (f64::from_ne_bytes(*double) as f32).to_ne_bytes();
        }
        Ok(())
    }
}
