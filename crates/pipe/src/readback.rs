//! Readbacks: fetched bytes as JSON for `--stats`, and as files.

use std::path::Path;

use pipe_graph::node::{FileElement, ReadbackFile};
use pipe_graph::types::{EdgeType, Element};
use pipe_io::mesh::Mesh;
use pipe_io::region::Samples;
use pipe_io::table::{Notation, Table};
use pipe_io::volume::{Volume, Voxel};

use crate::{Failure, plot};

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|w| f32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect()
}

fn table(bytes: &[u8], element: Element) -> Table {
    match element {
        Element::F32 => Table::Float(floats(bytes)),
        Element::U32 => Table::Uint(uints(bytes)),
    }
}

fn uints(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect()
}

/// A mesh from its fetched parts, of which `counts` says how much is filled.
pub(crate) fn mesh(name: &str, vertices: &[u8], triangles: &[u8], counts: &[u8]) -> Result<Mesh, Failure> {
    let (room, counts) = ([vertices.len() as u32 / 24, triangles.len() as u32 / 12], uints(counts));
    let [vertex_count, triangle_count] = [0, 1].map(|i| counts.get(i).copied().unwrap_or(0));
    if vertex_count > room[0] || triangle_count > room[1] {
        return Err(Failure::World(format!(
            "the mesh `{name}` has {vertex_count} vertices and {triangle_count} triangles, but there is room for {} and {}\n  \
             next: set `max_triangles` of the node to {triangle_count} or more",
            room[0], room[1]
        )));
    }
    let rows = floats(&vertices[..vertex_count as usize * 24]);
    let corners = uints(&triangles[..triangle_count as usize * 12]);
    Ok(Mesh {
        vertices: rows.chunks_exact(6).map(|v| [v[0], v[1], v[2]]).collect(),
        normals: rows.chunks_exact(6).map(|v| [v[3], v[4], v[5]]).collect(),
        triangles: corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    })
}

/// The pixels of a region with the wanted channels only.
fn region(bytes: &[u8], channels: u8, wanted: &[usize]) -> (Vec<f32>, usize) {
    let all = floats(bytes);
    if wanted.is_empty() {
        return (all, channels as usize);
    }
    // A grey image has the same value in every colour, and is opaque.
    let pick = |pixel: &[f32], c: usize| match (channels, c) {
        (1, 3) => 1.0,
        (1, _) => pixel[0],
        _ => pixel.get(c).copied().unwrap_or(if c == 3 { 1.0 } else { 0.0 }),
    };
    let picked = all.chunks_exact(channels as usize).flat_map(|p| wanted.iter().map(move |c| pick(p, *c))).collect();
    (picked, wanted.len())
}

/// The value as JSON: components, entries, or rows of pixels.
pub fn to_json(file: &ReadbackFile, bytes: &[u8]) -> serde_json::Value {
    match file.ty {
        EdgeType::Scalar(t) => Table::Float(floats(bytes).into_iter().take(t.components as usize).collect()).to_json(),
        EdgeType::Table(t) => table(bytes, t.element).to_json(),
        EdgeType::Image(t) => {
            let (values, channels) = region(bytes, t.channels, &file.channels);
            let (w, h) = (t.size[0] as usize, t.size[1] as usize);
            pipe_io::region::to_json(w, h, channels, Samples::F32(&values)).unwrap_or_default()
        }
        EdgeType::Volume(_) | EdgeType::Mesh(_) => serde_json::Value::Null,
    }
}

/// Writes the file of a readback, whole or not at all.
pub fn write(file: &ReadbackFile, bytes: &[u8]) -> Result<(), Failure> {
    let path = Path::new(&file.path);
    // Text says a number as it is; only an array has a type.
    let element = file.element.filter(|_| matches!(Notation::of(path), Ok(Notation::Npy)));
    match file.ty {
        EdgeType::Scalar(t) => {
            let values = floats(bytes).into_iter().take(t.components as usize).collect();
            write_table(path, &Table::Float(values), element)?;
        }
        EdgeType::Table(t) if plot::is_plot(path) => plot::write(path, &table(bytes, t.element))?,
        EdgeType::Table(t) => write_table(path, &table(bytes, t.element), element)?,
        EdgeType::Image(t) => {
            let (values, _) = region(bytes, t.channels, &file.channels);
            let (w, h) = (t.size[0] as usize, t.size[1] as usize);
            let names = channel_names(t.channels, &file.channels);
            let values = values.into_iter().map(f64::from);
            in_type(values, element.unwrap_or_default(), UNIT, |samples| pipe_io::region::write(path, w, h, &names, samples))?;
        }
        EdgeType::Volume(t) => {
            let volume = Volume::of_floats(t.size, t.channels, [1.0; 3], &floats(bytes), Voxel::F32);
            pipe_io::volume::write(path, &volume)?;
        }
        EdgeType::Mesh(_) => {}
    }
    Ok(())
}

/// What the channels of a region are called.
fn channel_names(channels: u8, wanted: &[usize]) -> Vec<&'static str> {
    let all = ["r", "g", "b", "a"];
    match (channels, wanted) {
        (1, []) => vec!["value"],
        (_, []) => all[..channels as usize].to_vec(),
        _ => wanted.iter().map(|c| all[*c]).collect(),
    }
}

fn write_table(path: &Path, table: &Table, element: Option<FileElement>) -> Result<(), pipe_io::Error> {
    let write = |samples: Samples<'_>| pipe_io::region::write_array(path, samples);
    match (element, table) {
        (None, _) => pipe_io::table::write(path, table),
        (Some(element), Table::Float(values)) => in_type(values.iter().copied().map(f64::from), element, UNIT, write),
        (Some(element), Table::Uint(counts)) => in_type(counts.iter().copied().map(f64::from), element, COUNTS, write),
    }
}

/// What 1 becomes in U8 and U16: the whole range of the type for floats, since files hold 0..1 so.
const UNIT: [f64; 2] = [255.0, 65535.0];
/// Counts stay counts.
const COUNTS: [f64; 2] = [1.0, 1.0];

/// Hands values over in a type. Integer types take the value rounded and clamped to their range, which casts do, too.
fn in_type<R>(values: impl Iterator<Item = f64>, element: FileElement, one: [f64; 2], to: impl FnOnce(Samples<'_>) -> R) -> R {
    match element {
        FileElement::U8 => to(Samples::U8(&values.map(|v| (v * one[0]).round() as u8).collect::<Vec<_>>())),
        FileElement::U16 => to(Samples::U16(&values.map(|v| (v * one[1]).round() as u16).collect::<Vec<_>>())),
        FileElement::I32 => to(Samples::I32(&values.map(|v| v.round() as i32).collect::<Vec<_>>())),
        FileElement::U32 => to(Samples::U32(&values.map(|v| v.round() as u32).collect::<Vec<_>>())),
        FileElement::F16 => to(Samples::F16(&values.map(half::f16::from_f64).collect::<Vec<_>>())),
        FileElement::F32 => to(Samples::F32(&values.map(|v| v as f32).collect::<Vec<_>>())),
    }
}

#[cfg(test)]
mod tests {
    use pipe_graph::types::{ScalarType, TableType};

    use super::*;

    /// The file that a readback of these words writes.
    fn written(name: &str, ty: EdgeType, element: Option<FileElement>, channels: &[usize], words: &[u32]) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let file = ReadbackFile { path: path.to_string_lossy().into_owned(), element, channels: channels.to_vec(), ty };
        let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        write(&file, &bytes).unwrap();
        std::fs::read(path).unwrap()
    }

    fn bits(values: &[f32]) -> Vec<u32> {
        values.iter().map(|v| v.to_bits()).collect()
    }

    #[test]
    fn csv_names_the_channels_that_it_holds() {
        let header = |channels: u8, wanted: &[usize]| {
            let pixel = bits(&[0.25, 0.5, 0.75, 1.0][..channels as usize]);
            String::from_utf8(written("r.csv", EdgeType::image([1, 1], channels), None, wanted, &pixel)).unwrap()
        };
        assert_eq!(header(1, &[]), "x,y,value\n0,0,0.25\n");
        assert_eq!(header(2, &[]), "x,y,r,g\n0,0,0.25,0.5\n");
        assert_eq!(header(4, &[]), "x,y,r,g,b,a\n0,0,0.25,0.5,0.75,1.0\n");
        assert_eq!(header(4, &[2, 1, 0]), "x,y,b,g,r\n0,0,0.75,0.5,0.25\n");
        assert_eq!(header(4, &[0, 1]), "x,y,r,g\n0,0,0.25,0.5\n");
        assert_eq!(header(4, &[3]), "x,y,a\n0,0,1.0\n");
    }

    #[test]
    fn arrays_have_the_type_that_was_asked_for() {
        let counts = EdgeType::Table(TableType { len: 3, element: Element::U32 });
        let curve = EdgeType::Table(TableType { len: 3, element: Element::F32 });
        let scalar = EdgeType::Scalar(ScalarType { components: 3 });
        let image = EdgeType::image([3, 1], 1);
        let array = |ty, element, words: &[u32], code: &str, data: &[u8]| {
            let file = written("r.npy", ty, Some(element), &[], words);
            assert!(String::from_utf8_lossy(&file).contains(code) && file.ends_with(data), "{ty:?} as {element:?}: {file:?}");
        };
        let ends = [0.5, 2.5, -1.5];
        for ty in [curve, scalar, image] {
            let words = bits(&ends);
            array(ty, FileElement::U8, &words, "|u1", &[128, 255, 0]);
            array(ty, FileElement::U16, &words, "<u2", &[0, 128, 255, 255, 0, 0]);
            array(ty, FileElement::I32, &words, "<i4", &[1_i32, 3, -2].map(i32::to_le_bytes).concat());
            array(ty, FileElement::U32, &words, "<u4", &[1_u32, 3, 0].map(u32::to_le_bytes).concat());
            array(ty, FileElement::F16, &words, "<f2", &ends.map(|v| half::f16::from_f32(v).to_le_bytes()).concat());
            array(ty, FileElement::F32, &words, "<f4", &ends.map(f32::to_le_bytes).concat());
        }
        array(counts, FileElement::U8, &[0, 7, 300], "|u1", &[0, 7, 255]);
        array(counts, FileElement::F32, &[0, 7, 300], "<f4", &[0.0_f32, 7.0, 300.0].map(f32::to_le_bytes).concat());
    }

    #[test]
    fn text_says_numbers_as_they_are() {
        for ty in [EdgeType::image([2, 1], 1), EdgeType::Table(TableType { len: 2, element: Element::F32 })] {
            for name in ["r.csv", "r.json"] {
                let words = bits(&[0.1, 7.5]);
                assert_eq!(written(name, ty, Some(FileElement::U8), &[], &words), written(name, ty, None, &[], &words), "{ty:?}, {name}");
            }
        }
    }
}
