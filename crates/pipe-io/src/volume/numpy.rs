//! NumPy arrays of shape (z, y, x) or (z, y, x, channels), in either order of memory.

use super::{Opened, Stored, VolumeFormat, VolumeHeader, Voxel, checked_size};
use crate::error::Fault;
use crate::npy::{self, Array, Element};
use crate::source::Limits;

pub(super) fn open(bytes: &[u8], limits: &Limits) -> Result<Opened, Fault> {
    let array = Array::parse(bytes)?;
    let stored = match array.element {
        Element::U8 => Stored::As(Voxel::U8),
        Element::I8 => Stored::As(Voxel::I8),
        Element::U16 => Stored::As(Voxel::U16),
        Element::I16 => Stored::As(Voxel::I16),
        Element::U32 => Stored::As(Voxel::U32),
        Element::I32 => Stored::As(Voxel::I32),
        Element::F16 => Stored::As(Voxel::F16),
        Element::F32 => Stored::As(Voxel::F32),
        Element::F64 => Stored::F64,
    };
    let shape: Vec<u64> = array.shape.iter().map(|n| *n as u64).collect();
    let (declared, channels) = match *shape.as_slice() {
        [z, y, x] => ([x, y, z], 1),
        [z, y, x, channels @ 1..=4] => ([x, y, z], channels),
        _ => return Err(Fault::unsupported("an array that is neither (z, y, x) nor (z, y, x, 1 to 4 channels); reshape it")),
    };
    let size = checked_size(declared, channels, stored, limits)?;
    let header = VolumeHeader::new(VolumeFormat::Npy, size, channels as u8, stored);
    let start = bytes.len() - array.rest.len();
    Ok(Opened { header, stored, big_endian: array.big_endian, detached: None, start, gzip: false, skip: Some(0), z_fastest: array.fortran })
}

pub(super) fn header(header: &VolumeHeader) -> Vec<u8> {
    let element = match header.voxel {
        Voxel::U8 => Element::U8,
        Voxel::I8 => Element::I8,
        Voxel::U16 => Element::U16,
        Voxel::I16 => Element::I16,
        Voxel::U32 => Element::U32,
        Voxel::I32 => Element::I32,
        Voxel::F16 => Element::F16,
        Voxel::F32 => Element::F32,
    };
    let [x, y, z] = header.size.map(|n| n as usize);
    let mut shape = vec![z, y, x];
    if header.channels > 1 {
        shape.push(header.channels.into());
    }
    npy::header(element, &shape)
}
