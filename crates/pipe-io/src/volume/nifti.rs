//! NIfTI-1 and NIfTI-2 in one file (`.nii`, `.nii.gz`), after the headers `nifti1.h` and `nifti2.h` of the NIfTI DFWG.
//!
//! Voxels are taken as they lie, x fastest; the file's orientation in the scanner is not applied.

use std::borrow::Cow;

use super::{GZIP, Opened, Stored, VolumeFormat, VolumeHeader, Voxel, checked_size, inflate};
use crate::error::Fault;
use crate::source::Limits;

/// Where NIfTI-2, the longer header, ends.
const HEADER_BYTES: usize = 540;

/// Whether a file begins so. Both versions begin with the length of their header.
pub(super) fn is_magic(bytes: &[u8]) -> bool {
    matches!(magic(bytes), Some(b"n+1\0" | b"ni1\0" | b"n+2\0" | b"ni2\0"))
}

fn magic(bytes: &[u8]) -> Option<&[u8]> {
    match bytes.get(..4)? {
        [92, 1, 0, 0] | [0, 0, 1, 92] => bytes.get(344..348),
        [28, 2, 0, 0] | [0, 0, 2, 28] => bytes.get(4..8),
        _ => None,
    }
}

/// Numbers of a header in either byte order.
struct Fields<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl Fields<'_> {
    fn word<const N: usize>(&self, at: usize) -> Result<[u8; N], Fault> {
        let word = self.bytes.get(at..at + N).and_then(|b| <[u8; N]>::try_from(b).ok());
        let mut word = word.ok_or_else(|| Fault::damaged("it ends within its header"))?;
        if self.big_endian {
            word.reverse();
        }
        Ok(word)
    }

    fn i16(&self, at: usize) -> Result<i64, Fault> {
        Ok(i16::from_le_bytes(self.word(at)?).into())
    }

    fn i64(&self, at: usize) -> Result<i64, Fault> {
        Ok(i64::from_le_bytes(self.word(at)?))
    }

    fn f32(&self, at: usize) -> Result<f64, Fault> {
        Ok(f32::from_le_bytes(self.word(at)?).into())
    }

    fn f64(&self, at: usize) -> Result<f64, Fault> {
        Ok(f64::from_le_bytes(self.word(at)?))
    }
}

/// What both versions say.
struct Content {
    dim: [i64; 8],
    datatype: i64,
    pixdim: [f64; 4],
    vox_offset: f64,
    slope: f64,
    intercept: f64,
}

impl Content {
    fn read(fields: &Fields<'_>, version: u8) -> Result<Self, Fault> {
        let (mut dim, mut pixdim) = ([0; 8], [0.0; 4]);
        for i in 0..8 {
            dim[i] = if version == 1 { fields.i16(40 + 2 * i)? } else { fields.i64(16 + 8 * i)? };
        }
        for i in 0..4 {
            pixdim[i] = if version == 1 { fields.f32(76 + 4 * i)? } else { fields.f64(104 + 8 * i)? };
        }
        Ok(if version == 1 {
            let datatype = fields.i16(70)?;
            Self { dim, datatype, pixdim, vox_offset: fields.f32(108)?, slope: fields.f32(112)?, intercept: fields.f32(116)? }
        } else {
            let vox_offset = fields.i64(168)? as f64;
            Self { dim, datatype: fields.i16(12)?, pixdim, vox_offset, slope: fields.f64(176)?, intercept: fields.f64(184)? }
        })
    }

    /// The voxel's type and channels.
    fn stored(&self) -> Result<(Stored, u8), Fault> {
        Ok(match self.datatype {
            2 => (Stored::As(Voxel::U8), 1),
            4 => (Stored::As(Voxel::I16), 1),
            8 => (Stored::As(Voxel::I32), 1),
            16 => (Stored::As(Voxel::F32), 1),
            64 => (Stored::F64, 1),
            128 => (Stored::As(Voxel::U8), 3),
            256 => (Stored::As(Voxel::I8), 1),
            512 => (Stored::As(Voxel::U16), 1),
            768 => (Stored::As(Voxel::U32), 1),
            1024 => (Stored::I64, 1),
            1280 => (Stored::U64, 1),
            2304 => (Stored::As(Voxel::U8), 4),
            other => return Err(Fault::unsupported(format!("data type {other}; convert it to float"))),
        })
    }

    /// Voxels along x, y and z, and points in time.
    fn extent(&self) -> Result<([u64; 3], u64), Fault> {
        let axes = usize::try_from(self.dim[0]).ok().filter(|n| (1..=7).contains(n));
        let axes = axes.ok_or_else(|| Fault::damaged(format!("it declares {} axes", self.dim[0])))?;
        let mut extent = [1; 8];
        for i in 1..=axes {
            extent[i] = u64::try_from(self.dim[i]).map_err(|_| Fault::damaged(format!("its axis {i} has {} voxels", self.dim[i])))?;
        }
        if extent[5..].iter().any(|n| *n > 1) {
            return Err(Fault::unsupported("more than four axes; save one volume of it"));
        }
        Ok(([extent[1], extent[2], extent[3]], extent[4].max(1)))
    }
}

/// Reads the header. `part` is the point in time of a series.
pub(super) fn open(bytes: &[u8], part: Option<&str>, limits: &Limits) -> Result<Opened, Fault> {
    let gzip = bytes.starts_with(&GZIP);
    let head = if gzip { Cow::Owned(inflate(bytes, 0, HEADER_BYTES)?) } else { Cow::Borrowed(bytes) };
    let version = match magic(&head) {
        Some(b"n+1\0") => 1,
        Some(b"n+2\0") => 2,
        Some(b"ni1\0" | b"ni2\0") => return Err(Fault::unsupported("a header and its voxels in two files; save it as one .nii file")),
        _ => return Err(Fault::damaged("it does not begin with a NIfTI header")),
    };
    let content = Content::read(&Fields { bytes: &head, big_endian: head[0] == 0 }, version)?;
    let (stored, channels) = content.stored()?;
    let (declared, times) = content.extent()?;
    let size = checked_size(declared, channels.into(), stored, limits)?;
    let time = match part {
        None if times == 1 => 0,
        None => return Err(Fault::unsupported(format!("a series of {times} volumes; choose one as file.nii#0 to #{}", times - 1))),
        Some(text) => text
            .parse()
            .ok()
            .filter(|t: &u64| *t < times)
            .ok_or_else(|| Fault::NoSuchLayer { wanted: text.to_owned(), available: format!("the points in time 0 to {}", times - 1) })?,
    };
    let mut header = VolumeHeader::new(VolumeFormat::Nifti, size, channels, stored);
    // A slope of 0 means none; one that changes nothing means no more than that.
    let scaled = content.slope.is_finite() && content.slope != 0.0 && (content.slope, content.intercept) != (1.0, 0.0);
    if scaled && channels == 1 {
        (header.scale, header.offset) = (content.slope as f32, if content.intercept.is_finite() { content.intercept as f32 } else { 0.0 });
    }
    header.spacing = std::array::from_fn(|i| Some(content.pixdim[i + 1].abs() as f32).filter(|s| *s > 0.0 && s.is_finite()).unwrap_or(1.0));
    let volume = (header.count() * stored.bytes()) as u64;
    let offset = content.vox_offset.max(0.0) as u64;
    let skip = time.checked_mul(volume).and_then(|t| t.checked_add(offset)).ok_or_else(|| Fault::damaged("its voxels begin nowhere"))?;
    Ok(Opened { header, stored, big_endian: head[0] == 0, detached: None, start: 0, gzip, skip: Some(skip), z_fastest: false })
}
