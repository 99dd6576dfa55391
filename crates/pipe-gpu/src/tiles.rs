//! Tiles: the same steps for every part of images that do not fit whole.
//!
//! Tile by tile, the pixels that it needs are brought, the few words of the uniform buffer that say where it lies are
//! written, the body is launched, and what it made is taken. One tile is finished before the next begins: its slots are
//! those of the next, and so is the memory of the host behind them.

use std::collections::HashMap;
use std::ops::Range;

use indexmap::IndexMap;
use pipe_plan::plan::{Crossing, Plan, Tile, Tiling};

use crate::device::Device;
use crate::error::GpuError;
use crate::transfer::copy_out;

/// Where pixels come from and go to, tile by tile.
pub trait Exchange {
    /// The rows of a picture that a tile needs, and where they lie. Tiles come row by row, so the same rows are asked for
    /// again for the tiles beside, and rows overlap those of the tiles above.
    ///
    /// Errors: a sentence for the user.
    fn rows(&mut self, from: &Crossing) -> Result<Rows<'_>, String>;

    /// Takes a rectangle of a picture: its rows, one after another.
    ///
    /// Errors: a sentence for the user.
    fn put(&mut self, to: &Crossing, bytes: &[u8]) -> Result<(), String>;
}

/// Rows of a picture in memory: of each plane `rows.end - rows.start` rows without padding, plane after plane.
#[derive(Debug, Clone)]
pub struct Rows<'a> {
    /// The pixels.
    pub bytes: &'a [u8],
    /// Which rows they are.
    pub rows: Range<u32>,
}

/// Whole pictures in memory.
#[derive(Debug)]
pub struct InMemory<'a> {
    inputs: &'a HashMap<&'a str, &'a [u8]>,
    outputs: IndexMap<String, Vec<u8>>,
}

impl<'a> InMemory<'a> {
    /// Takes tiles of these, by name.
    pub fn new(inputs: &'a HashMap<&'a str, &'a [u8]>) -> Self {
        Self { inputs, outputs: IndexMap::new() }
    }

    /// What was put together from tiles, by name.
    pub fn into_outputs(self) -> IndexMap<String, Vec<u8>> {
        self.outputs
    }
}

impl Exchange for InMemory<'_> {
    fn rows(&mut self, from: &Crossing) -> Result<Rows<'_>, String> {
        let bytes = self.inputs.get(from.name.as_str()).copied().unwrap_or_default();
        let rows = 0..from.size[1];
        let end = from.ranges(&rows).last().map_or(0, |r| r.end);
        if (bytes.len() as u64) < end {
            let short = GpuError::ShortInput { name: from.name.clone(), got: bytes.len() as u64, wanted: end };
            return Err(short.to_string());
        }
        Ok(Rows { bytes, rows })
    }

    fn put(&mut self, to: &Crossing, bytes: &[u8]) -> Result<(), String> {
        let [w, h] = to.size.map(u64::from);
        let picture = self.outputs.entry(to.name.clone()).or_default();
        let planes_end = (u64::from(to.plane) + 1) * w * h * u64::from(to.pixel);
        picture.resize(picture.len().max(planes_end as usize), 0);
        let mut at = 0;
        for range in to.ranges(&(0..to.size[1])) {
            let n = (range.end - range.start) as usize;
            copy_out(&mut picture[range.start as usize..range.end as usize], &bytes[at..at + n]);
            at += n;
        }
        Ok(())
    }
}

/// The tiling at a place of a plan.
pub(crate) fn tiling(plan: &Plan, step: usize) -> Result<&Tiling, GpuError> {
    plan.tilings_at(step).ok_or_else(|| GpuError::Plan { node: plan.name.clone(), reason: format!("step {step} is no tiling") })
}

/// Writes the words of the uniform buffer that say where a tile lies.
pub(crate) fn place(device: &Device, plan: &Plan, buffer: &wgpu::Buffer, tile: &Tile) {
    let Some(first) = tile.uniforms.iter().map(|(at, _)| *at).min() else { return };
    let end = tile.uniforms.iter().map(|(at, _)| at + 4).max().unwrap_or(first);
    let mut bytes = plan.uniforms[first as usize..end as usize].to_vec();
    for (at, word) in &tile.uniforms {
        let at = (at - first) as usize;
        bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
    }
    device.queue.write_buffer(buffer, first.into(), &bytes);
}
