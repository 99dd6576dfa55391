//! NRRD, after "Definition of NRRD File Format" of Teem: raw and gzip, attached and detached.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use super::{Opened, Stored, VolumeFormat, VolumeHeader, Voxel, checked_size};
use crate::error::Fault;
use crate::source::Limits;

/// The fields of a header, by name in lower case, and where it ends.
fn fields(bytes: &[u8]) -> Result<(HashMap<String, String>, usize), Fault> {
    let mut fields = HashMap::new();
    let mut at = 0;
    loop {
        let rest = &bytes[at..];
        let end = rest.iter().position(|b| *b == b'\n');
        // A detached header may end without an empty line.
        let line = end.map_or(rest, |end| &rest[..end]);
        let line = std::str::from_utf8(line).map_err(|_| Fault::damaged("its header is no text"))?.trim_end_matches('\r');
        at += end.map_or(rest.len(), |end| end + 1);
        if line.is_empty() {
            return Ok((fields, at));
        }
        // `#` begins a comment, `:=` separates a user's own key from its value.
        if let Some((key, value)) = line.split_once(": ").filter(|_| !line.starts_with('#')) {
            fields.insert(key.trim().to_ascii_lowercase(), value.trim().to_owned());
        }
        if end.is_none() {
            return Ok((fields, at));
        }
    }
}

fn stored(name: &str) -> Result<Stored, Fault> {
    Ok(match name {
        "signed char" | "int8" | "int8_t" => Stored::As(Voxel::I8),
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Stored::As(Voxel::U8),
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Stored::As(Voxel::I16),
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Stored::As(Voxel::U16),
        "int" | "signed int" | "int32" | "int32_t" => Stored::As(Voxel::I32),
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Stored::As(Voxel::U32),
        "longlong" | "long long" | "long long int" | "signed long long" | "signed long long int" | "int64" | "int64_t" => Stored::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Stored::U64,
        "float" => Stored::As(Voxel::F32),
        "double" => Stored::F64,
        other => return Err(Fault::unsupported(format!("voxels of type `{other}`; convert it to float"))),
    })
}

/// How many axes at the front are the channels of a voxel: 0 or 1.
fn channel_axes(sizes: &[u64], kinds: Option<&String>) -> Result<usize, Fault> {
    let domain = |kind: &str| matches!(kind, "domain" | "space" | "time" | "???" | "none");
    let kinds: Vec<String> = kinds.map(|k| k.split_whitespace().map(str::to_ascii_lowercase).collect()).unwrap_or_default();
    if kinds.iter().skip(1).any(|kind| !domain(kind)) {
        return Err(Fault::unsupported("channels that are not the fastest axis; reorder it with `unu permute`"));
    }
    Ok(match kinds.first() {
        Some(first) => usize::from(!domain(first)),
        None => usize::from(sizes.len() == 4 && sizes[0] <= 4),
    })
}

/// Spacing of the axes that are no channels.
fn spacing(fields: &HashMap<String, String>, skip: usize) -> [f32; 3] {
    let length = |vector: &str| -> Option<f32> {
        let parts = vector.trim().strip_prefix('(')?.strip_suffix(')')?.split(',');
        let squares: Option<Vec<f64>> = parts.map(|n| n.trim().parse::<f64>().ok().map(|n| n * n)).collect();
        Some(squares?.into_iter().sum::<f64>().sqrt() as f32)
    };
    let given: Vec<Option<f32>> = match (fields.get("spacings"), fields.get("space directions")) {
        (Some(numbers), _) => numbers.split_whitespace().map(|n| n.parse().ok()).collect(),
        // A vector may have blanks inside; `none` stands for an axis without one.
        (None, Some(vectors)) => vectors.replace("none", "()").split_inclusive(')').map(length).collect(),
        (None, None) => Vec::new(),
    };
    let usable = |s: &f32| s.is_finite() && *s > 0.0;
    std::array::from_fn(|i| given.get(i + skip).copied().flatten().filter(usable).unwrap_or(1.0))
}

pub(super) fn open(bytes: &[u8], limits: &Limits) -> Result<Opened, Fault> {
    let (fields, start) = fields(bytes)?;
    let need = |key: &str| fields.get(key).ok_or_else(|| Fault::damaged(format!("it has no `{key}`")));
    let stored = stored(&need("type")?.to_ascii_lowercase())?;
    let sizes: Result<Vec<u64>, _> = need("sizes")?.split_whitespace().map(str::parse).collect();
    let sizes = sizes.map_err(|_| Fault::damaged("its `sizes` are no list of numbers"))?;
    if need("dimension")?.parse() != Ok(sizes.len()) {
        return Err(Fault::damaged("its `dimension` is not the number of its `sizes`"));
    }
    let channel_axes = channel_axes(&sizes, fields.get("kinds"))?;
    let (channels, axes) = sizes.split_at(channel_axes.min(sizes.len()));
    let channels = channels.first().copied().unwrap_or(1);
    if !(1..=4).contains(&channels) {
        return Err(Fault::unsupported(format!("{channels} channels; a volume has 1 to 4")));
    }
    let declared = match *axes {
        [x, y] => [x, y, 1],
        [x, y, z] | [x, y, z, 1] => [x, y, z],
        _ => return Err(Fault::unsupported(format!("{} axes; save one volume of it", sizes.len()))),
    };
    let gzip = match need("encoding")?.to_ascii_lowercase().as_str() {
        "raw" => false,
        "gzip" | "gz" => true,
        other => return Err(Fault::unsupported(format!("the encoding `{other}`; save it as raw or gzip"))),
    };
    let big_endian = match fields.get("endian").map(String::as_str) {
        Some("big") => true,
        Some("little") => false,
        None if stored.bytes() == 1 => false,
        _ => return Err(Fault::damaged("it does not say `endian: little` or `big`")),
    };
    if fields.get("line skip").or(fields.get("lineskip")).is_some_and(|n| n != "0") {
        return Err(Fault::unsupported("`line skip`; use `byte skip`"));
    }
    let skip = match fields.get("byte skip").or(fields.get("byteskip")).map(|n| n.parse::<i64>()) {
        None => Some(0),
        Some(Ok(-1)) if !gzip => None,
        Some(Ok(n @ 0..)) => Some(n as u64),
        Some(_) => return Err(Fault::damaged("its `byte skip` is no number of bytes")),
    };
    let detached = match fields.get("data file").or(fields.get("datafile")) {
        Some(list) if list == "LIST" || list.starts_with("LIST ") || list.contains('%') => {
            return Err(Fault::unsupported("voxels in several files; save it as one"));
        }
        name => name.map(PathBuf::from),
    };
    let size = checked_size(declared, channels, stored, limits)?;
    let mut header = VolumeHeader::new(VolumeFormat::Nrrd, size, channels as u8, stored);
    header.spacing = spacing(&fields, channel_axes);
    let start = if detached.is_some() { 0 } else { start };
    Ok(Opened { header, stored, big_endian, detached, start, gzip, skip, z_fastest: false })
}

/// An attached header for little-endian raw voxels.
pub(super) fn header(header: &VolumeHeader) -> Result<Vec<u8>, Fault> {
    let kind = match header.voxel {
        Voxel::U8 => "uint8",
        Voxel::I8 => "int8",
        Voxel::U16 => "uint16",
        Voxel::I16 => "int16",
        Voxel::U32 => "uint32",
        Voxel::I32 => "int32",
        Voxel::F32 => "float",
        Voxel::F16 => return Err(Fault::Form("NRRD has no half floats; write float, or .npy".to_owned())),
    };
    let ([x, y, z], [dx, dy, dz], channels) = (header.size, header.spacing, header.channels);
    let mut text = format!("NRRD0004\ntype: {kind}\n");
    let _ = match channels {
        1 => write!(text, "dimension: 3\nsizes: {x} {y} {z}\nspacings: {dx} {dy} {dz}\nkinds: domain domain domain\n"),
        _ => {
            let kind = if channels == 4 { "RGBA-color" } else { "vector" };
            write!(text, "dimension: 4\nsizes: {channels} {x} {y} {z}\nspacings: nan {dx} {dy} {dz}\nkinds: {kind} domain domain domain\n")
        }
    };
    text.push_str("endian: little\nencoding: raw\n\n");
    Ok(text.into_bytes())
}
