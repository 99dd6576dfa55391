//! Volumes between files and host memory: NRRD, NIfTI, NPY, and raw voxels whose size the user says.
//!
//! A header becomes a [`VolumeHeader`] and the place of the voxels; one function then reads them, whatever the format.
//! Voxels stay in their own type, x fastest, channels together: the GPU's first kernel converts them. Only 64-bit
//! numbers are narrowed here, since nothing behind this could use their digits.
//!
//! Whole numbers of 8 and 16 unsigned bits stand for 0..1, as in images, unless the file says what they mean (NIfTI's
//! `scl_slope`); all other numbers stand for themselves.
//!
//! Rejected: the `nifti` crate, which brings `ndarray` and an allocation of the declared size before the first check.

mod nifti;
mod nrrd;
mod numpy;
mod raw;

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use flate2::read::MultiGzDecoder;

use crate::atomic::AtomicFile;
use crate::error::{Error, Fault, Result};
use crate::guard::shielded;
use crate::picture::Sample;
use crate::source::{self, Limits, Source, load};

/// A file format for volumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VolumeFormat {
    /// Nearly raw raster data, attached or detached (`.nhdr`), raw or gzip.
    Nrrd,
    /// NIfTI-1 and -2 in one file, plain or gzip. Read only.
    Nifti,
    /// NumPy array of shape (z, y, x) or (z, y, x, channels).
    Npy,
    /// Voxels and nothing else.
    Raw,
}

impl VolumeFormat {
    const ALL: [Self; 4] = [Self::Nrrd, Self::Nifti, Self::Npy, Self::Raw];

    /// The format's own name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nrrd => "NRRD",
            Self::Nifti => "NIfTI",
            Self::Npy => "NPY",
            Self::Raw => "raw",
        }
    }

    const fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Nrrd => &[".nrrd", ".nhdr"],
            Self::Nifti => &[".nii", ".nii.gz"],
            Self::Npy => &[".npy"],
            Self::Raw => &[".raw"],
        }
    }

    /// The format that the end of a file name stands for, in any case.
    pub fn of_name(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.endings().iter().any(|ending| name.ends_with(ending)))
    }

    fn sniff(bytes: &[u8]) -> Option<Self> {
        match bytes {
            _ if bytes.starts_with(b"NRRD000") => Some(Self::Nrrd),
            _ if bytes.starts_with(b"\x93NUMPY") => Some(Self::Npy),
            _ if bytes.starts_with(&GZIP) || nifti::is_magic(bytes) => Some(Self::Nifti),
            _ => None,
        }
    }
}

/// The type of a voxel in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Voxel {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F16,
    F32,
}

impl Voxel {
    /// Bytes of one voxel's channel.
    pub const fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
        }
    }

    /// What a stored number is multiplied by when the file does not say.
    const fn scale(self) -> f32 {
        match self {
            Self::U8 => 1.0 / 255.0,
            Self::U16 => 1.0 / 65535.0,
            _ => 1.0,
        }
    }
}

/// The type of a voxel in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stored {
    As(Voxel),
    U64,
    I64,
    F64,
}

impl Stored {
    const fn bytes(self) -> usize {
        match self {
            Self::As(voxel) => voxel.bytes(),
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    const fn voxel(self) -> Voxel {
        match self {
            Self::As(voxel) => voxel,
            Self::U64 | Self::I64 | Self::F64 => Voxel::F32,
        }
    }

    /// Native bytes of this type as native bytes of [`Stored::voxel`].
    fn narrowed(self, bytes: Vec<u8>) -> Vec<u8> {
        let eights = || bytes.as_chunks::<8>().0.iter();
        match self {
            Self::As(_) => bytes,
            Self::U64 => eights().flat_map(|b| (u64::from_ne_bytes(*b) as f32).to_ne_bytes()).collect(),
            Self::I64 => eights().flat_map(|b| (i64::from_ne_bytes(*b) as f32).to_ne_bytes()).collect(),
            Self::F64 => eights().flat_map(|b| (f64::from_ne_bytes(*b) as f32).to_ne_bytes()).collect(),
        }
    }
}

/// What a file says about its volume.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeHeader {
    /// The format it was read from.
    pub format: VolumeFormat,
    /// Voxels along x (fastest), y and z.
    pub size: [u32; 3],
    /// 1 to 4, together at each voxel.
    pub channels: u8,
    /// Type in memory.
    pub voxel: Voxel,
    /// Value = stored number × scale + offset.
    pub scale: f32,
    /// See `scale`.
    pub offset: f32,
    /// Distance between voxel centres along x, y and z, in the file's unit; 1 where it says nothing.
    pub spacing: [f32; 3],
}

/// A volume in host memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    /// What it is.
    pub header: VolumeHeader,
    /// Voxels in native byte order, x fastest, channels together.
    pub bytes: Vec<u8>,
}

impl VolumeHeader {
    /// A header of plain numbers, as the formats start from.
    fn new(format: VolumeFormat, size: [u32; 3], channels: u8, stored: Stored) -> Self {
        let voxel = stored.voxel();
        Self { format, size, channels, voxel, scale: voxel.scale(), offset: 0.0, spacing: [1.0; 3] }
    }

    /// Numbers in the volume, which [`checked_size`] has seen to fit.
    fn count(&self) -> usize {
        self.size.iter().map(|n| *n as usize).product::<usize>() * usize::from(self.channels)
    }
}

impl Volume {
    /// A volume of floats to be written, in this type: 8 and 16 unsigned bits stand for 0..1.
    pub fn of_floats(size: [u32; 3], channels: u8, spacing: [f32; 3], floats: &[f32], voxel: Voxel) -> Self {
        let unit = |v: f32, most: f32| (v.clamp(0.0, 1.0) * most + 0.5).floor();
        let bytes = match voxel {
            Voxel::U8 => floats.iter().map(|v| unit(*v, 255.0) as u8).collect(),
            Voxel::U16 => floats.iter().flat_map(|v| (unit(*v, 65535.0) as u16).to_ne_bytes()).collect(),
            Voxel::F16 => floats.iter().flat_map(|v| half::f16::from_f32(*v).to_ne_bytes()).collect(),
            Voxel::I8 => floats.iter().flat_map(|v| (v.round() as i8).to_ne_bytes()).collect(),
            Voxel::I16 => floats.iter().flat_map(|v| (v.round() as i16).to_ne_bytes()).collect(),
            Voxel::U32 => floats.iter().flat_map(|v| (v.round() as u32).to_ne_bytes()).collect(),
            Voxel::I32 => floats.iter().flat_map(|v| (v.round() as i32).to_ne_bytes()).collect(),
            Voxel::F32 => bytemuck::cast_slice(floats).to_vec(),
        };
        let header = VolumeHeader { spacing, ..VolumeHeader::new(VolumeFormat::Raw, size, channels, Stored::As(voxel)) };
        Self { header, bytes }
    }

    /// The same from the native bytes of the floats, which are kept when floats are wanted.
    pub fn of_bytes(size: [u32; 3], channels: u8, spacing: [f32; 3], bytes: Vec<u8>, voxel: Voxel) -> Self {
        if voxel != Voxel::F32 {
            let floats: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
            return Self::of_floats(size, channels, spacing, &floats, voxel);
        }
        let header = VolumeHeader { spacing, ..VolumeHeader::new(VolumeFormat::Raw, size, channels, Stored::As(voxel)) };
        Self { header, bytes }
    }

    /// Every value, converted as the GPU converts it.
    pub fn values(&self) -> Vec<f32> {
        fn each<const N: usize>(bytes: &[u8], f: impl Fn([u8; N]) -> f32) -> Vec<f32> {
            bytes.as_chunks::<N>().0.iter().map(|b| f(*b)).collect()
        }
        let bytes = &self.bytes;
        let stored = match self.header.voxel {
            Voxel::U8 => each(bytes, |[b]| b.into()),
            Voxel::I8 => each(bytes, |b| i8::from_ne_bytes(b).into()),
            Voxel::U16 => each(bytes, |b| u16::from_ne_bytes(b).into()),
            Voxel::I16 => each(bytes, |b| i16::from_ne_bytes(b).into()),
            Voxel::U32 => each(bytes, |b| u32::from_ne_bytes(b) as f32),
            Voxel::I32 => each(bytes, |b| i32::from_ne_bytes(b) as f32),
            Voxel::F16 => each(bytes, |b| half::f16::from_ne_bytes(b).to_f32()),
            Voxel::F32 => each(bytes, f32::from_ne_bytes),
        };
        stored.into_iter().map(|v| v * self.header.scale + self.header.offset).collect()
    }
}

/// A header with what it takes to read the voxels.
struct Opened {
    header: VolumeHeader,
    stored: Stored,
    big_endian: bool,
    /// A file beside the header that holds the voxels; the same file when absent.
    detached: Option<PathBuf>,
    /// Where the voxels, or the compressed stream that holds them, begin.
    start: usize,
    gzip: bool,
    /// Bytes before the voxels, after decompression; `None`: the voxels are the last bytes.
    skip: Option<u64>,
    /// Whether z, not x, is fastest in the file.
    z_fastest: bool,
}

const GZIP: [u8; 2] = [0x1f, 0x8b];

/// A declared size as a volume's, if it is none that no memory could hold.
fn checked_size(declared: [u64; 3], channels: u64, stored: Stored, limits: &Limits) -> Result<[u32; 3], Fault> {
    let [x, y, z] = declared;
    if declared.contains(&0) {
        return Err(Fault::damaged(format!("it declares an empty volume ({x}×{y}×{z})")));
    }
    let bytes = declared.iter().chain([&channels, &(stored.bytes() as u64)]).try_fold(1_u64, |product, n| product.checked_mul(*n));
    match (bytes, declared.map(u32::try_from)) {
        (Some(bytes), [Ok(x), Ok(y), Ok(z)]) if bytes <= limits.max_bytes => Ok([x, y, z]),
        _ => {
            let most = limits.max_bytes;
            Err(Fault::TooLarge(format!("it declares {x}×{y}×{z} voxels of {channels} channels, more than the limit of {most} bytes")))
        }
    }
}

/// What the header of a file says. Reads only the beginning of the file.
pub fn probe(source: &Source, limits: &Limits) -> Result<VolumeHeader> {
    const BEGINNING: u64 = 1 << 20;
    let Some(path) = &source.path else { return Ok(read(source, limits)?.header) };
    let failed = |error| Error::read(source, error);
    let mut bytes = Vec::new();
    source::open(source, path)?.take(BEGINNING).read_to_end(&mut bytes).map_err(failed)?;
    let (_, opened) = open(source, &bytes, limits)?;
    Ok(opened.header)
}

/// Reads a volume. What follows `#` is the size and type of a raw file (`181x217x181:u8`, `:f32be`), or the point in time
/// of a NIfTI series, from 0.
///
/// Errors: the file cannot be read, is damaged, or declares more than the limits allow.
pub fn read(source: &Source, limits: &Limits) -> Result<Volume> {
    let mut bytes = load(source, limits)?;
    let (format, opened) = open(source, &bytes, limits)?;
    if let Some(beside) = &opened.detached {
        let folder = source.path.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
        bytes = load(&Source::file(folder.join(beside)), limits)?;
    }
    let voxels = shielded(|| voxels(&opened, bytes));
    Ok(Volume { bytes: voxels.map_err(|fault| fault.named(source, format.name()))?, header: opened.header })
}

fn open(source: &Source, bytes: &[u8], limits: &Limits) -> Result<(VolumeFormat, Opened)> {
    let part = source.layer.as_deref();
    if source.path.as_deref().and_then(VolumeFormat::of_name) == Some(VolumeFormat::Raw) {
        let form = part.and_then(raw::Form::parse).ok_or_else(|| Error::argument(source.to_string(), raw::Form::EXPECTED))?;
        let opened = raw::open(form, limits).map_err(|fault| fault.named(source, VolumeFormat::Raw.name()))?;
        return Ok((VolumeFormat::Raw, opened));
    }
    let format = VolumeFormat::sniff(bytes).ok_or_else(|| Error::UnknownFormat {
        file: source.to_string(),
        what: "volume",
        known: "NRRD, NIfTI, NPY (raw voxels are read as file.raw#WxHxD:TYPE)".to_owned(),
    })?;
    let opened = shielded(|| match (format, part) {
        (VolumeFormat::Nifti, _) => nifti::open(bytes, part, limits),
        (_, Some(part)) => Err(Fault::NoSuchLayer { wanted: part.to_owned(), available: format!("none, being a {} file", format.name()) }),
        (VolumeFormat::Nrrd, None) => nrrd::open(bytes, limits),
        (_, None) => numpy::open(bytes, limits),
    });
    Ok((format, opened.map_err(|fault| fault.named(source, format.name()))?))
}

/// The voxels of a file, of which `bytes` is all.
fn voxels(opened: &Opened, mut bytes: Vec<u8>) -> Result<Vec<u8>, Fault> {
    let wanted = opened.header.count() * opened.stored.bytes();
    let short = |have: u64| Fault::damaged(format!("its size and type ask for {wanted} bytes of voxels, but it has {have}"));
    if opened.gzip {
        bytes = inflate(bytes.get(opened.start..).unwrap_or_default(), opened.skip.unwrap_or(0), wanted)?;
    } else {
        let start = match opened.skip {
            Some(skip) => opened.start.saturating_add(usize::try_from(skip).unwrap_or(usize::MAX)),
            None => bytes.len().saturating_sub(wanted).max(opened.start),
        };
        bytes.drain(..start.min(bytes.len()));
    }
    if bytes.len() < wanted {
        return Err(short(bytes.len() as u64));
    }
    if opened.header.format == VolumeFormat::Raw && bytes.len() > wanted {
        return Err(Fault::damaged(format!("{} bytes are more than the {wanted} of the size and type after `#`", bytes.len())));
    }
    bytes.truncate(wanted);
    if opened.big_endian != cfg!(target_endian = "big") {
        bytes.chunks_exact_mut(opened.stored.bytes()).for_each(<[u8]>::reverse);
    }
    let bytes = opened.stored.narrowed(bytes);
    Ok(if opened.z_fastest { transposed(&opened.header, &bytes) } else { bytes })
}

/// At most `wanted` bytes of what a stream holds after the first `skip`.
fn inflate(stream: &[u8], skip: u64, wanted: usize) -> Result<Vec<u8>, Fault> {
    let damaged = |error: io::Error| Fault::damaged(format!("its compressed data cannot be read: {error}"));
    let mut decoder = MultiGzDecoder::new(stream);
    io::copy(&mut decoder.by_ref().take(skip), &mut io::sink()).map_err(damaged)?;
    // Deflate makes at most 1032 bytes of one, so a small file cannot ask for much memory.
    let mut bytes = Vec::with_capacity(wanted.min(stream.len().saturating_mul(1032)));
    decoder.take(wanted as u64).read_to_end(&mut bytes).map_err(damaged)?;
    Ok(bytes)
}

/// Voxels whose slowest axis is x, x fastest; channels, then slowest of all, together.
fn transposed(header: &VolumeHeader, bytes: &[u8]) -> Vec<u8> {
    let ([w, h, d], channels, each) = (header.size.map(|n| n as usize), usize::from(header.channels), header.voxel.bytes());
    let mut out = Vec::with_capacity(bytes.len());
    for z in 0..d {
        for y in 0..h {
            for x in 0..w {
                for c in 0..channels {
                    let at = (((c * w + x) * h + y) * d + z) * each;
                    out.extend_from_slice(&bytes[at..at + each]);
                }
            }
        }
    }
    out
}

/// Writes a volume; the end of the file's name chooses the format. The file appears only when it is complete.
pub fn write(path: &Path, volume: &Volume) -> Result<()> {
    let format = format_written(path)?;
    let header = match format {
        VolumeFormat::Nrrd => nrrd::header(&volume.header).map_err(|fault| fault.named(path.display(), format.name()))?,
        VolumeFormat::Npy => numpy::header(&volume.header),
        VolumeFormat::Raw | VolumeFormat::Nifti => Vec::new(),
    };
    let failed = |error: io::Error| Error::write(path.display(), error);
    let mut bytes = std::borrow::Cow::Borrowed(volume.bytes.as_slice());
    if cfg!(target_endian = "big") {
        bytes.to_mut().chunks_exact_mut(volume.header.voxel.bytes()).for_each(<[u8]>::reverse);
    }
    let mut file = AtomicFile::create(Some(path)).map_err(failed)?;
    file.write_all(&header).and_then(|()| file.write_all(&bytes)).map_err(failed)?;
    file.commit().map_err(failed)
}

/// The type that voxels are written in: floats unless the user asked for another.
///
/// Errors: the format of this name is not written, or cannot hold that type.
pub fn voxel_written(path: &Path, asked: Option<Sample>) -> Result<Voxel> {
    match (format_written(path)?, asked) {
        (VolumeFormat::Nrrd, Some(Sample::F16)) => {
            Err(Error::Form { file: path.display().to_string(), reason: "NRRD has no half floats; write float, or .npy".to_owned() })
        }
        (_, None | Some(Sample::F32)) => Ok(Voxel::F32),
        (_, Some(Sample::F16)) => Ok(Voxel::F16),
        (_, Some(Sample::U8)) => Ok(Voxel::U8),
        (_, Some(Sample::U16)) => Ok(Voxel::U16),
    }
}

fn format_written(path: &Path) -> Result<VolumeFormat> {
    let header_only = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("nhdr"));
    match VolumeFormat::of_name(path) {
        Some(format) if format != VolumeFormat::Nifti && !header_only => Ok(format),
        _ => Err(Error::UnknownExtension { file: path.display().to_string(), known: ".nrrd .npy .raw".to_owned() }),
    }
}
