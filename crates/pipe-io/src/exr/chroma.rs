//! Luminance and subsampled chroma → RGB.
//!
//! OpenEXR's `RgbaInputFile` does the same with the same filter; the constants and the formulas are those of
//! `ImfRgbaYca.cpp` (RY = (R−Y)/Y, BY = (B−Y)/Y; a 27-tap filter whose even taps are zero). What it does afterwards,
//! lowering the saturation of isolated pixels to hide overshoot, is left out: it is a matter of taste, not of decoding.

use rayon::prelude::*;

use super::{Opened, decode};
use crate::error::Fault;
use crate::picture::{Sample, Window};
use crate::source::Limits;

/// Half of the symmetric filter, from the tap nearest the pixel outwards (distances 1, 3, … 13).
const TAPS: [f32; 7] = [0.627_123, -0.186_077, 0.087_929, -0.043_159, 0.019_597, -0.007_540, 0.002_128];

/// Planes R, G, B (and A) of the display window as f32.
pub(super) fn read(opened: &Opened, bytes: &[u8], limits: &Limits) -> Result<Vec<u8>, Fault> {
    let part = opened.part();
    let sampling = |slot: usize| opened.layer.channels[slot].map(|index| part.channels.list[index].sampling);
    let expected = [Some(exr::math::Vec2(1, 1)), Some(exr::math::Vec2(2, 2)), Some(exr::math::Vec2(2, 2))];
    let full_size_alpha = opened.layer.channels.len() < 4 || sampling(3) == expected[0];
    if [sampling(0), sampling(1), sampling(2)] != expected || !full_size_alpha {
        return Err(Fault::unsupported("chroma that is not subsampled by two both ways; save it as RGB"));
    }
    let data = opened.data;
    let even = data.x % 2 == 0 && data.y % 2 == 0;
    if !even || !data.width.is_multiple_of(2) || !data.height.is_multiple_of(2) {
        return Err(Fault::damaged("its chroma is subsampled by two, but its data window is odd"));
    }
    limits.check(data.width.into(), data.height.into(), 16)?;

    let planes = decode::read(opened, &bytes, &opened.layer.channels, Sample::F32, data)?;
    let planes: Vec<f32> = planes.as_chunks::<4>().0.iter().map(|&four| f32::from_ne_bytes(four)).collect();
    let (w, h) = (data.width as usize, data.height as usize);
    let (y_plane, rest) = planes.split_at(w * h);
    let (ry, rest) = rest.split_at(w / 2 * (h / 2));
    let (by, alpha) = rest.split_at(w / 2 * (h / 2));
    let (ry, by) = (upsample(ry, w / 2, h / 2), upsample(by, w / 2, h / 2));

    let weights = opened.primaries().to_xyz().map_or([0.2126, 0.7152, 0.0722], |matrix| matrix[1]);
    let [wr, wg, wb] = weights.map(|weight| weight as f32);
    let mut rgb = vec![0.0; w * h * 3];
    let (red, rest) = rgb.split_at_mut(w * h);
    let (green, blue) = rest.split_at_mut(w * h);
    for i in 0..w * h {
        let y = y_plane[i];
        let (r, b) = ((ry[i] + 1.0) * y, (by[i] + 1.0) * y);
        // Grey stays exactly grey.
        let grey = ry[i] == 0.0 && by[i] == 0.0;
        [red[i], green[i], blue[i]] = if grey { [y; 3] } else { [r, (y - r * wr - b * wb) / wg, b] };
    }
    let mut planes: Vec<&[f32]> = vec![red, green, blue];
    if !alpha.is_empty() {
        planes.push(alpha);
    }
    Ok(place(&planes, data, opened.display))
}

/// Doubles both sides of a plane: samples stay on the even pixels, those between are filtered.
fn upsample(chroma: &[f32], width: usize, height: usize) -> Vec<f32> {
    let mut wide = vec![0.0; width * 2 * height];
    wide.par_chunks_mut(width * 2).zip(chroma.par_chunks(width)).for_each(|(out, line)| {
        for x in 0..width {
            out[2 * x] = line[x];
            out[2 * x + 1] = between(x, width, |i| line[i]);
        }
    });
    let mut full = vec![0.0; width * 2 * height * 2];
    full.par_chunks_mut(width * 4).enumerate().for_each(|(y, pair)| {
        let (even, odd) = pair.split_at_mut(width * 2);
        even.copy_from_slice(&wide[y * width * 2..(y + 1) * width * 2]);
        for (x, out) in odd.iter_mut().enumerate() {
            *out = between(y, height, |i| wide[i * width * 2 + x]);
        }
    });
    full
}

/// The value halfway between samples `i` and `i + 1`; samples beyond the border repeat it.
fn between(i: usize, count: usize, at: impl Fn(usize) -> f32) -> f32 {
    let tap = |(distance, weight): (usize, &f32)| weight * (at(i.saturating_sub(distance)) + at((i + 1 + distance).min(count - 1)));
    TAPS.iter().enumerate().map(tap).sum()
}

/// Moves planes of the data window into zeroed planes of the display window.
fn place(planes: &[&[f32]], data: Window, display: Window) -> Vec<u8> {
    let (width, height) = (display.width as usize, display.height as usize);
    let mut bytes = vec![0; planes.len() * width * height * 4];
    let (dx, dy) = (i64::from(data.x) - i64::from(display.x), i64::from(data.y) - i64::from(display.y));
    let columns = dx.max(0)..(dx + i64::from(data.width)).min(width as i64);
    for (plane, out) in planes.iter().zip(bytes.chunks_mut(width * height * 4)) {
        for (y, row) in out.chunks_mut(width * 4).enumerate() {
            let from = y as i64 - dy;
            if columns.is_empty() || from < 0 || from >= i64::from(data.height) {
                continue;
            }
            let start = from as usize * data.width as usize + (columns.start - dx) as usize;
            let line = &plane[start..start + (columns.end - columns.start) as usize];
            let target = &mut row[columns.start as usize * 4..columns.end as usize * 4];
            target.copy_from_slice(bytemuck::cast_slice(line));
        }
    }
    bytes
}
