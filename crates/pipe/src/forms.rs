//! Between the words of `pipe-io` and those of the planner's rim.

use pipe_graph::rim::{Alpha, Layout, PixelForm, Sample, Transfer, Voxel, VoxelForm};
use pipe_graph::types::{Precision, VolumeType};
use pipe_io::volume::VolumeHeader;
use pipe_io::{Channels, Colour, Form, Header, Picture};

fn sample(s: pipe_io::Sample) -> Sample {
    match s {
        pipe_io::Sample::U8 => Sample::U8,
        pipe_io::Sample::U16 => Sample::U16,
        pipe_io::Sample::F16 => Sample::F16,
        pipe_io::Sample::F32 => Sample::F32,
    }
}

fn layout(l: pipe_io::Layout) -> Layout {
    match l {
        pipe_io::Layout::Interleaved => Layout::Interleaved,
        pipe_io::Layout::Planar => Layout::Planar,
    }
}

fn alpha(a: pipe_io::Alpha) -> Alpha {
    match a {
        pipe_io::Alpha::None => Alpha::None,
        pipe_io::Alpha::Associated => Alpha::Associated,
        pipe_io::Alpha::Straight => Alpha::Straight,
    }
}

fn transfer(c: &Colour) -> Transfer {
    match c.transfer {
        pipe_io::Transfer::Linear => Transfer::Linear,
        pipe_io::Transfer::Srgb => Transfer::Srgb,
        pipe_io::Transfer::Gamma(g) => Transfer::Gamma(g),
    }
}

/// Number of channels as stored.
pub(crate) const fn count(c: Channels) -> u8 {
    match c {
        Channels::Y => 1,
        Channels::Ya => 2,
        Channels::Rgb => 3,
        Channels::Rgba => 4,
    }
}

/// How a decoded picture lies in memory.
pub(crate) fn of_picture(p: &Picture) -> PixelForm {
    let form = Form { sample: p.sample, layout: p.layout, channels: p.channels, alpha: p.alpha, colour: p.colour };
    of_input(&form, [p.width, p.height])
}

/// How a picture of this header lies in memory once it is decoded.
pub(crate) fn of_header(h: &Header, layout: pipe_io::Layout) -> PixelForm {
    let form = Form { sample: h.sample, layout, channels: h.channels, alpha: h.alpha, colour: h.colour };
    of_input(&form, [h.width, h.height])
}

fn of_input(f: &Form, size: [u32; 2]) -> PixelForm {
    PixelForm { matrix: clean(f.colour.to_working_matrix()), ..of_form(f, size) }
}

/// How a writer wants its pixels.
pub(crate) fn of_form(f: &Form, size: [u32; 2]) -> PixelForm {
    PixelForm {
        size,
        channels: count(f.channels),
        sample: sample(f.sample),
        layout: layout(f.layout),
        alpha: alpha(f.alpha),
        transfer: transfer(&f.colour),
        matrix: clean(f.colour.from_working_matrix()),
    }
}

fn voxel(v: pipe_io::volume::Voxel) -> Voxel {
    use pipe_io::volume::Voxel as File;
    match v {
        File::U8 => Voxel::U8,
        File::I8 => Voxel::I8,
        File::U16 => Voxel::U16,
        File::I16 => Voxel::I16,
        File::U32 => Voxel::U32,
        File::I32 => Voxel::I32,
        File::F16 => Voxel::F16,
        File::F32 => Voxel::F32,
    }
}

/// How a decoded volume lies in memory.
pub(crate) fn of_volume(header: &VolumeHeader) -> VoxelForm {
    let VolumeHeader { size, channels, scale, offset, .. } = *header;
    VoxelForm { size, channels, voxel: voxel(header.voxel), scale, offset }
}

/// The volume in the graph.
pub(crate) fn volume_type(header: &VolumeHeader) -> VolumeType {
    VolumeType { size: header.size, channels: of_volume(header).volume_channels(), precision: Precision::F32 }
}

/// A matrix within rounding of the identity is the identity, so that unchanged pixels stay so to the bit.
fn clean(m: [[f32; 3]; 3]) -> [[f32; 3]; 3] {
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let near = m.iter().flatten().zip(identity.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-6);
    if near { identity } else { m }
}

/// Channels of the image in the graph.
pub(crate) const fn image_channels(c: Channels) -> u8 {
    if matches!(c, Channels::Y) { 1 } else { 4 }
}
