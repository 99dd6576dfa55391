//! Voxels and nothing else: their size and type come from the command line.

use super::{Opened, Stored, VolumeFormat, VolumeHeader, Voxel, checked_size};
use crate::error::Fault;
use crate::source::Limits;

const TYPES: [(&str, Stored); 11] = [
    ("u8", Stored::As(Voxel::U8)),
    ("i8", Stored::As(Voxel::I8)),
    ("u16", Stored::As(Voxel::U16)),
    ("i16", Stored::As(Voxel::I16)),
    ("u32", Stored::As(Voxel::U32)),
    ("i32", Stored::As(Voxel::I32)),
    ("u64", Stored::U64),
    ("i64", Stored::I64),
    ("f16", Stored::As(Voxel::F16)),
    ("f32", Stored::As(Voxel::F32)),
    ("f64", Stored::F64),
];

/// Reads `181x217x181:u8`: the size, channels as a fourth number, and the type, `be` behind it for big-endian.
pub(super) fn open(part: Option<&str>, limits: &Limits) -> Result<Opened, Fault> {
    let expected = "say its size and type as file.raw#WxHxD:TYPE, such as #181x217x181:u8 (types u8 i8 u16 i16 u32 i32 u64 i64 f16 f32 f64, \
                    with `be` behind it when big-endian; channels as a fourth number)";
    let unknown = || Fault::unsupported(expected);
    let (size, kind) = part.and_then(|part| part.split_once(':').or(Some((part, "u8")))).ok_or_else(unknown)?;
    let (kind, big_endian) = kind.strip_suffix("be").map_or((kind, false), |kind| (kind, true));
    let (_, stored) = TYPES.into_iter().find(|(name, _)| *name == kind).ok_or_else(unknown)?;
    let numbers: Option<Vec<u64>> = size.split('x').map(|n| n.parse().ok()).collect();
    let (declared, channels) = match numbers.as_deref() {
        Some(&[x, y, z]) => ([x, y, z], 1),
        Some(&[x, y, z, channels @ 1..=4]) => ([x, y, z], channels),
        _ => return Err(unknown()),
    };
    let size = checked_size(declared, channels, stored, limits)?;
    let header = VolumeHeader::new(VolumeFormat::Raw, size, channels as u8, stored);
    Ok(Opened { header, stored, big_endian, detached: None, start: 0, gzip: false, skip: Some(0), z_fastest: false })
}
