//! Bytes between the host and buffers.
//!
//! On a device that shares the host's memory, buffers are mapped and nothing is copied twice. On a GPU, uploads go
//! through a few staging buffers that are made once and reused (a fresh one costs more than the transfer), downloads
//! through one staging buffer that is kept. Copies between mapped memory and the caller's run on all cores: mapped
//! memory is slow for a single one.

use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;
use wgpu::WriteOnly;

use crate::device::Device;
use crate::error::GpuError;

/// Bytes of one staging buffer.
const CHUNK: u64 = 32 << 20;

/// Bytes that one thread copies at a time.
const PIECE: usize = 4 << 20;

/// Staging memory, kept.
#[derive(Default)]
pub(crate) struct Transfer {
    up: Vec<wgpu::Buffer>,
    down: Option<wgpu::Buffer>,
}

/// Copies between slices on all cores.
pub(crate) fn copy_out(to: &mut [u8], from: &[u8]) {
    to.par_chunks_mut(PIECE).zip(from.par_chunks(PIECE)).for_each(|(to, from)| to.copy_from_slice(from));
}

/// A part of mapped memory and what goes there.
struct Piece<'m, 's> {
    to: WriteOnly<'m, [u8]>,
    from: &'s [u8],
}

// SAFETY: a `WriteOnly` is a unique borrow of plain bytes, as `&mut [u8]` is, which may be sent to another thread; wgpu
// leaves the marker out only because it cannot say so for every element type. Pieces are disjoint parts of one view,
// which outlives the scope that copies them. One core writes mapped memory at a third of the speed of eight.
#[allow(unsafe_code)]
unsafe impl Send for Piece<'_, '_> {}

impl Piece<'_, '_> {
    fn copy(&mut self) {
        self.to.copy_from_slice(self.from);
    }
}

/// The part `at` of the concatenation of `ranges` of `source`, into mapped memory, on all cores.
fn gather(mut to: WriteOnly<'_, [u8]>, source: &[u8], ranges: &[Range<u64>], mut at: u64) {
    let mut pieces = Vec::new();
    let mut start = 0_u64;
    for range in ranges {
        let end = start + (range.end - range.start);
        while at < end && at >= start && to.len() > 0 {
            let from = (range.start + (at - start)) as usize;
            let n = ((end - at) as usize).min(to.len()).min(PIECE);
            let piece = to.split_off(..n).expect("no longer than what is left");
            pieces.push(Piece { to: piece, from: &source[from..from + n] });
            at += n as u64;
        }
        start = end;
    }
    rayon::scope(|scope| pieces.into_iter().for_each(|mut piece| scope.spawn(move |_| piece.copy())));
    // What is left is padding up to a whole word.
    to.fill(0);
}

impl Transfer {
    /// Writes ranges of `source`, one after another, to the start of `buffer`.
    pub(crate) fn upload(
        &mut self,
        device: &Device,
        buffer: &wgpu::Buffer,
        source: &[u8],
        ranges: &[Range<u64>],
        deadline: Option<Instant>,
    ) -> Result<(), GpuError> {
        let total: u64 = ranges.iter().map(|r| r.end - r.start).sum();
        let padded = total.next_multiple_of(4).min(buffer.size());
        if buffer.usage().contains(wgpu::BufferUsages::MAP_WRITE) {
            map(device, buffer, wgpu::MapMode::Write, padded, deadline, "upload")?;
            write_mapped(buffer, padded, |to| gather(to, source, ranges, 0))?;
            return Ok(());
        }
        if padded <= 1 << 16 {
            let mut bytes: Vec<u8> = ranges.iter().flat_map(|r| &source[r.start as usize..r.end as usize]).copied().collect();
            bytes.resize(padded as usize, 0);
            device.queue.write_buffer(buffer, 0, &bytes);
            return Ok(());
        }
        let mut at = 0;
        let mut turn = 0;
        while at < padded {
            let n = CHUNK.min(padded - at);
            if self.up.len() <= turn % 2 {
                self.up.push(device.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("upload"),
                    size: CHUNK,
                    usage: wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                }));
            }
            let staging = &self.up[turn % 2];
            // Mapping waits until the copy that used this buffer last is done.
            map(device, staging, wgpu::MapMode::Write, n, deadline, "upload")?;
            write_mapped(staging, n, |to| gather(to, source, ranges, at))?;
            let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(staging, 0, buffer, at, n);
            device.queue.submit([encoder.finish()]);
            at += n;
            turn += 1;
        }
        device.check("upload")
    }

    /// Reads the starts of several buffers, each `bytes` long, and hands them out in order.
    pub(crate) fn download(
        &mut self,
        device: &Device,
        buffers: &[(&wgpu::Buffer, u64)],
        deadline: Option<Instant>,
        mut take: impl FnMut(usize, &[u8]),
    ) -> Result<(), GpuError> {
        let padded = |n: u64| n.next_multiple_of(4);
        let mut staged: Vec<(usize, u64)> = Vec::new();
        let mut total = 0_u64;
        for (i, (buffer, bytes)) in buffers.iter().enumerate() {
            if buffer.usage().contains(wgpu::BufferUsages::MAP_READ) {
                map(device, buffer, wgpu::MapMode::Read, padded(*bytes), deadline, "readback")?;
                read_mapped(buffer, 0..padded(*bytes), |from| take(i, &from[..*bytes as usize]))?;
                buffer.unmap();
            } else {
                staged.push((i, total));
                total += padded(*bytes).next_multiple_of(8);
            }
        }
        if staged.is_empty() {
            return Ok(());
        }
        if self.down.as_ref().is_none_or(|b| b.size() < total) {
            self.down = Some(device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("readback"),
                size: total,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        let down = self.down.as_ref().expect("made above");
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (i, offset) in &staged {
            let (buffer, bytes) = buffers[*i];
            encoder.copy_buffer_to_buffer(buffer, 0, down, *offset, padded(bytes));
        }
        device.queue.submit([encoder.finish()]);
        map(device, down, wgpu::MapMode::Read, total, deadline, "readback")?;
        for (i, offset) in &staged {
            let bytes = buffers[*i].1;
            read_mapped(down, *offset..offset + padded(bytes), |from| take(*i, &from[..bytes as usize]))?;
        }
        down.unmap();
        Ok(())
    }
}

fn write_mapped(buffer: &wgpu::Buffer, bytes: u64, write: impl FnOnce(WriteOnly<'_, [u8]>)) -> Result<(), GpuError> {
    let refused = |e: wgpu::MapRangeError| GpuError::Refused { node: "upload".into(), message: e.to_string() };
    let mut view = buffer.get_mapped_range_mut(0..bytes).map_err(refused)?;
    write(view.slice(..));
    drop(view);
    buffer.unmap();
    Ok(())
}

fn read_mapped(buffer: &wgpu::Buffer, range: Range<u64>, read: impl FnOnce(&[u8])) -> Result<(), GpuError> {
    let refused = |e: wgpu::MapRangeError| GpuError::Refused { node: "readback".into(), message: e.to_string() };
    let view = buffer.get_mapped_range(range).map_err(refused)?;
    read(&view);
    Ok(())
}

/// Maps the start of a buffer, waiting at most until the deadline.
fn map(
    device: &Device,
    buffer: &wgpu::Buffer,
    mode: wgpu::MapMode,
    bytes: u64,
    deadline: Option<Instant>,
    node: &str,
) -> Result<(), GpuError> {
    let (send, receive) = std::sync::mpsc::channel();
    buffer.map_async(mode, 0..bytes, move |result| drop(send.send(result)));
    wait(device, None, deadline, node)?;
    match receive.recv() {
        Ok(Ok(())) => Ok(()),
        Ok(Err(e)) => {
            device.check(node)?;
            Err(GpuError::Refused { node: node.to_owned(), message: e.to_string() })
        }
        Err(_) => Err(GpuError::Lost { node: node.to_owned(), reason: "the driver never answered".into() }),
    }
}

/// Waits for a submission, or for everything.
pub(crate) fn wait(
    device: &Device,
    submission: Option<wgpu::SubmissionIndex>,
    deadline: Option<Instant>,
    node: &str,
) -> Result<(), GpuError> {
    let started = Instant::now();
    let timeout = deadline.map(|d| d.saturating_duration_since(started));
    match device.device.poll(wgpu::PollType::Wait { submission_index: submission, timeout }) {
        Ok(_) => device.check(node),
        Err(wgpu::PollError::Timeout) => Err(GpuError::Timeout { node: node.to_owned(), seconds: 0 }),
        Err(e) => {
            device.check(node)?;
            Err(GpuError::Refused { node: node.to_owned(), message: e.to_string() })
        }
    }
}
