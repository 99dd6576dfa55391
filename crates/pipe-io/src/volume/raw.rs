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

/// What the user says of a raw file.
#[derive(Clone, Copy)]
pub(super) struct Form {
    declared: [u64; 3],
    channels: u64,
    stored: Stored,
    big_endian: bool,
}

impl Form {
    /// What [`Form::parse`] would have understood.
    pub(super) const EXPECTED: &str = "a raw volume of known size: write file.raw#WxHxD:TYPE, such as #181x217x181:u8 \
         (u8 i8 u16 i16 u32 i32 u64 i64 f16 f32 f64, big-endian with `be` behind it; channels as a fourth number)";

    /// Reads `181x217x181:u8`: the size, channels as a fourth number, and the type, `be` behind it for big-endian.
    pub(super) fn parse(part: &str) -> Option<Self> {
        let (size, kind) = part.split_once(':').unwrap_or((part, "u8"));
        let (kind, big_endian) = kind.strip_suffix("be").map_or((kind, false), |kind| (kind, true));
        let (_, stored) = TYPES.into_iter().find(|(name, _)| *name == kind)?;
        let numbers: Option<Vec<u64>> = size.split('x').map(|n| n.parse().ok()).collect();
        let (declared, channels) = match *numbers?.as_slice() {
            [x, y, z] => ([x, y, z], 1),
            [x, y, z, channels @ 1..=4] => ([x, y, z], channels),
            _ => return None,
        };
        Some(Self { declared, channels, stored, big_endian })
    }
}

/// The voxels of a file of this form.
pub(super) fn open(part: Form, limits: &Limits) -> Result<Opened, Fault> {
    let Form { declared, channels, stored, big_endian } = part;
    let size = checked_size(declared, channels, stored, limits)?;
    let header = VolumeHeader::new(VolumeFormat::Raw, size, channels as u8, stored);
    Ok(Opened { header, stored, big_endian, detached: None, start: 0, gzip: false, skip: Some(0), z_fastest: false })
}
