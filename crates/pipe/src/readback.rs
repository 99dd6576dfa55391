//! Readbacks: fetched bytes as JSON for `--stats`, and as files.

use std::path::Path;

use pipe_graph::node::{FileElement, ReadbackFile};
use pipe_graph::types::{EdgeType, Element};
use pipe_io::mesh::Mesh;
use pipe_io::region::Samples;
use pipe_io::table::Table;
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
    match file.ty {
        EdgeType::Scalar(t) => {
            let values = floats(bytes).into_iter().take(t.components as usize).collect();
            pipe_io::table::write(path, &Table::Float(values))?;
        }
        EdgeType::Table(t) if plot::is_plot(path) => plot::write(path, &table(bytes, t.element))?,
        EdgeType::Table(t) => pipe_io::table::write(path, &table(bytes, t.element))?,
        EdgeType::Image(t) => {
            let (values, channels) = region(bytes, t.channels, &file.channels);
            let (w, h) = (t.size[0] as usize, t.size[1] as usize);
            write_region(path, w, h, channels, &values, file.element.unwrap_or_default())?;
        }
        EdgeType::Volume(t) => {
            let volume = Volume::of_floats(t.size, t.channels, [1.0; 3], &floats(bytes), Voxel::F32);
            pipe_io::volume::write(path, &volume)?;
        }
        EdgeType::Mesh(_) => {}
    }
    Ok(())
}

/// Integer types take the value rounded and clamped to their range; U8 and U16 stand for 0..1.
fn write_region(path: &Path, w: usize, h: usize, channels: usize, v: &[f32], element: FileElement) -> Result<(), Failure> {
    let unit = |v: &f32, most: f32| (v.clamp(0.0, 1.0) * most + 0.5) as u32;
    match element {
        FileElement::F32 => pipe_io::region::write(path, w, h, channels, Samples::F32(v))?,
        FileElement::F16 => {
            let v: Vec<half::f16> = v.iter().map(|v| half::f16::from_f32(*v)).collect();
            pipe_io::region::write(path, w, h, channels, Samples::F16(&v))?;
        }
        FileElement::U8 => {
            let v: Vec<u8> = v.iter().map(|v| unit(v, 255.0) as u8).collect();
            pipe_io::region::write(path, w, h, channels, Samples::U8(&v))?;
        }
        FileElement::U16 => {
            let v: Vec<u16> = v.iter().map(|v| unit(v, 65535.0) as u16).collect();
            pipe_io::region::write(path, w, h, channels, Samples::U16(&v))?;
        }
        FileElement::I32 => {
            let v: Vec<i32> = v.iter().map(|v| v.round() as i32).collect();
            pipe_io::region::write(path, w, h, channels, Samples::I32(&v))?;
        }
        FileElement::U32 => {
            let v: Vec<u32> = v.iter().map(|v| v.round() as u32).collect();
            pipe_io::region::write(path, w, h, channels, Samples::U32(&v))?;
        }
    }
    Ok(())
}
