//! Bytes between the host and buffers.
//!
//! On a device that shares the host's memory, the kernels' own buffers are mapped and nothing is copied twice. On a
//! GPU, bytes go through a few staging buffers that are made once and reused: a fresh one costs more than the transfer
//! (60 ms for 256 MiB on an H100, against 9 ms for the copy). While the device copies one, the host fills or empties
//! another. Copies between mapped memory and the caller's run on all cores: mapped memory is slow for a single one.
//!
//! Rejected: `Queue::write_buffer` for images, which allocates and faults new staging pages at every call (4 GB/s
//! there, against 30); one staging buffer as large as the image, for the same reason.

use std::ops::Range;

use rayon::prelude::*;
use wgpu::{BufferUsages, MapMode, SubmissionIndex, WriteOnly};

use crate::device::Device;
use crate::error::GpuError;
use crate::patience::Patience;

/// Most bytes of one staging buffer.
const CHUNK: u64 = 32 << 20;

/// Fewest bytes of one staging buffer.
const LEAST: u64 = 1 << 20;

/// Staging buffers in each direction.
const RING: usize = 2;

/// Bytes that one thread copies at a time.
const PIECE: usize = 4 << 20;

/// Uploads up to this size go through wgpu's own staging, many of them in one submission.
const SMALL: u64 = 64 << 10;

/// Staging memory, kept.
pub(crate) struct Transfer {
    up: Ring,
    down: Ring,
    /// Bytes of a staging buffer.
    chunk: u64,
}

struct Ring {
    usage: BufferUsages,
    /// Buffers with the submission that used each last.
    buffers: Vec<(wgpu::Buffer, Option<SubmissionIndex>)>,
    turn: usize,
}

impl Ring {
    const fn new(usage: BufferUsages) -> Self {
        Self { usage, buffers: Vec::new(), turn: 0 }
    }

    /// The next buffer's place; the buffer has at least `bytes` bytes.
    fn next(&mut self, device: &Device, bytes: u64) -> usize {
        let at = self.turn % RING;
        self.turn += 1;
        let size = bytes.next_power_of_two().max(LEAST);
        if self.buffers.len() <= at || self.buffers[at].0.size() < size {
            let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("staging"),
                size,
                usage: self.usage,
                mapped_at_creation: false,
            });
            if self.buffers.len() <= at {
                self.buffers.push((buffer, None));
            } else {
                self.buffers[at] = (buffer, None);
            }
        }
        at
    }
}

/// A range of a buffer on its way to the host.
struct Piece {
    source: usize,
    at: u64,
    bytes: u64,
    staged_at: u64,
}

/// A part of mapped memory and what goes there.
struct Gathered<'m, 's> {
    to: WriteOnly<'m, [u8]>,
    from: &'s [u8],
}

// SAFETY: a `WriteOnly` is a unique borrow of plain bytes, as `&mut [u8]` is, which may be sent to another thread; wgpu
// implements `Send` for it only where the element type is `Sized`. The parts are disjoint and within one view, which
// outlives the scope that copies them. One core writes mapped memory at a third of the speed of eight.
#[allow(unsafe_code)]
unsafe impl Send for Gathered<'_, '_> {}

impl Gathered<'_, '_> {
    fn copy(&mut self) {
        self.to.copy_from_slice(self.from);
    }
}

/// Copies between slices of equal length on all cores.
pub(crate) fn copy_out(to: &mut [u8], from: &[u8]) {
    to.par_chunks_mut(PIECE).zip(from.par_chunks(PIECE)).for_each(|(to, from)| to.copy_from_slice(from));
}

/// The part from `at` on of the concatenation of `ranges` of `source`, into mapped memory, on all cores.
fn gather(mut to: WriteOnly<'_, [u8]>, source: &[u8], ranges: &[Range<u64>], mut at: u64) {
    let mut parts = Vec::new();
    let mut start = 0_u64;
    for range in ranges {
        let end = start + (range.end - range.start);
        while at >= start && at < end && !to.is_empty() {
            let from = (range.start + (at - start)) as usize;
            let n = ((end - at) as usize).min(to.len()).min(PIECE);
            let part = to.split_off(..n).expect("no longer than what is left");
            parts.push(Gathered { to: part, from: &source[from..from + n] });
            at += n as u64;
        }
        start = end;
    }
    match parts.as_mut_slice() {
        [only] => only.copy(),
        _ => rayon::scope(|scope| parts.into_iter().for_each(|mut part| scope.spawn(move |_| part.copy()))),
    }
    // What is left is padding up to a whole word.
    to.fill(0);
}

impl Transfer {
    pub(crate) const fn new() -> Self {
        Self {
            up: Ring::new(BufferUsages::MAP_WRITE.union(BufferUsages::COPY_SRC)),
            down: Ring::new(BufferUsages::MAP_READ.union(BufferUsages::COPY_DST)),
            chunk: CHUNK,
        }
    }

    /// Makes staging buffers take no more than `bytes` together, as far as that is reasonable.
    pub(crate) fn fit(&mut self, bytes: u64) {
        let chunk = (bytes / (2 * RING as u64)).clamp(LEAST, CHUNK);
        let chunk = if chunk.is_power_of_two() { chunk } else { chunk.next_power_of_two() / 2 };
        if chunk < self.chunk {
            self.up.buffers.clear();
            self.down.buffers.clear();
        }
        self.chunk = chunk;
    }

    /// Writes ranges of `source`, one after another, to the start of `buffer`.
    pub(crate) fn upload(
        &mut self,
        device: &Device,
        buffer: &wgpu::Buffer,
        source: &[u8],
        ranges: &[Range<u64>],
        patience: &Patience<'_>,
        node: &str,
    ) -> Result<(), GpuError> {
        let total: u64 = ranges.iter().map(|r| r.end - r.start).sum();
        let padded = total.next_multiple_of(4);
        if padded > buffer.size() {
            let reason = format!("{total} bytes go into a slot of {}", buffer.size());
            return Err(GpuError::Plan { node: node.to_owned(), reason });
        }
        if padded == 0 {
            return Ok(());
        }
        if buffer.usage().contains(BufferUsages::MAP_WRITE) {
            patience.map(device, buffer, MapMode::Write, padded, None, node)?;
            return write_mapped(buffer, padded, |to| gather(to, source, ranges, 0), node);
        }
        if padded <= SMALL {
            let mut bytes: Vec<u8> = ranges.iter().flat_map(|r| &source[r.start as usize..r.end as usize]).copied().collect();
            bytes.resize(padded as usize, 0);
            device.queue.write_buffer(buffer, 0, &bytes);
            return Ok(());
        }
        let mut at = 0;
        while at < padded {
            let n = self.chunk.min(padded - at);
            let turn = self.up.next(device, n);
            let (staging, last) = &mut self.up.buffers[turn];
            patience.map(device, staging, MapMode::Write, n, last.as_ref(), node)?;
            write_mapped(staging, n, |to| gather(to, source, ranges, at), node)?;
            let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(staging, 0, buffer, at, n);
            *last = Some(device.queue.submit([encoder.finish()]));
            device.check(node)?;
            at += n;
        }
        Ok(())
    }

    /// Reads the starts of several buffers, each `bytes` long, and hands them out in pieces: the buffer's place in the
    /// list, the offset, the bytes. `after` is the submission that wrote them.
    pub(crate) fn download(
        &mut self,
        device: &Device,
        buffers: &[(&wgpu::Buffer, u64)],
        patience: &Patience<'_>,
        node: &str,
        take: &mut dyn FnMut(usize, u64, &[u8]),
    ) -> Result<(), GpuError> {
        let mut staged: Vec<Vec<Piece>> = Vec::new();
        let mut room = 0;
        for (source, (buffer, bytes)) in buffers.iter().enumerate() {
            let padded = bytes.next_multiple_of(4);
            if padded > buffer.size() {
                let reason = format!("{bytes} bytes are fetched from a slot of {}", buffer.size());
                return Err(GpuError::Plan { node: node.to_owned(), reason });
            }
            if buffer.usage().contains(BufferUsages::MAP_READ) {
                if padded > 0 {
                    patience.map(device, buffer, MapMode::Read, padded, None, node)?;
                    read_mapped(buffer, 0..padded, |from| take(source, 0, &from[..*bytes as usize]), node)?;
                    buffer.unmap();
                }
                continue;
            }
            let mut at = 0;
            while at < *bytes {
                if room == 0 {
                    staged.push(Vec::new());
                    room = self.chunk;
                }
                let n = room.min(*bytes - at);
                let last = staged.last_mut().expect("pushed above");
                last.push(Piece { source, at, bytes: n, staged_at: self.chunk - room });
                room -= n.next_multiple_of(8).min(room);
                at += n;
            }
        }
        // One chunk ahead of the one that is read.
        let mut flying = std::collections::VecDeque::new();
        for chunk in staged {
            let turn = self.stage(device, buffers, &chunk, node)?;
            flying.push_back((turn, chunk));
            if flying.len() == RING {
                self.land(device, flying.pop_front().expect("pushed above"), patience, node, take)?;
            }
        }
        while let Some(first) = flying.pop_front() {
            self.land(device, first, patience, node, take)?;
        }
        device.check(node)
    }

    /// Sends a chunk on its way into a staging buffer.
    fn stage(&mut self, device: &Device, buffers: &[(&wgpu::Buffer, u64)], chunk: &[Piece], node: &str) -> Result<usize, GpuError> {
        let turn = self.down.next(device, chunk_bytes(chunk));
        let (staging, last) = &mut self.down.buffers[turn];
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for piece in chunk {
            let n = piece.bytes.next_multiple_of(4);
            encoder.copy_buffer_to_buffer(buffers[piece.source].0, piece.at, staging, piece.staged_at, n);
        }
        *last = Some(device.queue.submit([encoder.finish()]));
        device.check(node)?;
        Ok(turn)
    }

    /// Hands out what arrived.
    fn land(
        &self,
        device: &Device,
        (turn, chunk): (usize, Vec<Piece>),
        patience: &Patience<'_>,
        node: &str,
        take: &mut dyn FnMut(usize, u64, &[u8]),
    ) -> Result<(), GpuError> {
        let (staging, last) = &self.down.buffers[turn];
        let bytes = chunk_bytes(&chunk);
        patience.map(device, staging, MapMode::Read, bytes, last.as_ref(), node)?;
        let hand_out = |from: &[u8]| {
            for piece in &chunk {
                take(piece.source, piece.at, &from[piece.staged_at as usize..(piece.staged_at + piece.bytes) as usize]);
            }
        };
        read_mapped(staging, 0..bytes, hand_out, node)?;
        staging.unmap();
        Ok(())
    }
}

fn chunk_bytes(chunk: &[Piece]) -> u64 {
    chunk.last().map_or(0, |p| p.staged_at + p.bytes.next_multiple_of(4))
}

fn write_mapped(buffer: &wgpu::Buffer, bytes: u64, write: impl FnOnce(WriteOnly<'_, [u8]>), node: &str) -> Result<(), GpuError> {
    let refused = |e: wgpu::MapRangeError| GpuError::Refused { node: node.to_owned(), message: e.to_string() };
    let mut view = buffer.get_mapped_range_mut(0..bytes).map_err(refused)?;
    write(view.slice(..));
    drop(view);
    buffer.unmap();
    Ok(())
}

fn read_mapped(buffer: &wgpu::Buffer, range: Range<u64>, read: impl FnOnce(&[u8]), node: &str) -> Result<(), GpuError> {
    let refused = |e: wgpu::MapRangeError| GpuError::Refused { node: node.to_owned(), message: e.to_string() };
    let view = buffer.get_mapped_range(range).map_err(refused)?;
    read(&view);
    Ok(())
}
