//! Triangle meshes to files: Wavefront OBJ as text, Stanford PLY as little-endian binary.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::atomic::AtomicFile;
use crate::error::{Error, Result};

/// A triangle mesh whose triangles share vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions.
    pub vertices: Vec<[f32; 3]>,
    /// Unit normals, one a vertex.
    pub normals: Vec<[f32; 3]>,
    /// Vertices of each triangle, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A file format for meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// Stanford PLY.
    Ply,
}

impl MeshFormat {
    /// By the extension of a path.
    ///
    /// Errors: it is no mesh's.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        match extension.to_ascii_lowercase().as_str() {
            "obj" => Ok(Self::Obj),
            "ply" => Ok(Self::Ply),
            _ => Err(Error::UnknownExtension { file: path.display().to_string(), known: ".obj .ply".to_owned() }),
        }
    }
}

/// Writes a mesh; the extension of `path` chooses the format. The file appears only when it is complete.
pub fn write(path: &Path, mesh: &Mesh) -> Result<()> {
    let format = MeshFormat::of(path)?;
    let failed = |error: io::Error| Error::write(path.display(), error);
    let mut file = AtomicFile::create(Some(path)).map_err(failed)?;
    let mut out = BufWriter::with_capacity(1 << 20, &mut file);
    let written = match format {
        MeshFormat::Obj => obj(&mut out, mesh),
        MeshFormat::Ply => ply(&mut out, mesh),
    };
    written.and_then(|()| out.flush()).map_err(failed)?;
    drop(out);
    file.commit().map_err(failed)
}

fn obj(out: &mut impl Write, mesh: &Mesh) -> io::Result<()> {
    for [x, y, z] in &mesh.vertices {
        writeln!(out, "v {x} {y} {z}")?;
    }
    for [x, y, z] in &mesh.normals {
        writeln!(out, "vn {x} {y} {z}")?;
    }
    for [a, b, c] in mesh.triangles.iter().map(|t| t.map(|i| i + 1)) {
        writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
    }
    Ok(())
}

fn ply(out: &mut impl Write, mesh: &Mesh) -> io::Result<()> {
    let (vertices, triangles) = (mesh.vertices.len(), mesh.triangles.len());
    write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\n")?;
    for property in ["x", "y", "z", "nx", "ny", "nz"] {
        writeln!(out, "property float {property}")?;
    }
    write!(out, "element face {triangles}\nproperty list uchar uint vertex_indices\nend_header\n")?;
    for (vertex, normal) in mesh.vertices.iter().zip(&mesh.normals) {
        for number in vertex.iter().chain(normal) {
            out.write_all(&number.to_le_bytes())?;
        }
    }
    for triangle in &mesh.triangles {
        out.write_all(&[3])?;
        for index in triangle {
            out.write_all(&index.to_le_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Mesh {
        let vertices = vec![[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [0.0, 1.0, 0.5]];
        Mesh { vertices, normals: vec![[0.0, 0.0, 1.0]; 3], triangles: vec![[0, 1, 2]] }
    }

    #[test]
    fn obj_counts_from_one() {
        let mut out = Vec::new();
        obj(&mut out, &triangle()).unwrap();
        let text = String::from_utf8(out).unwrap();
        assert!(text.starts_with("v 0 0 0.5\nv 1 0 0.5\n") && text.ends_with("vn 0 0 1\nf 1//1 2//2 3//3\n"), "{text}");
    }

    #[test]
    fn ply_is_as_long_as_its_header_says() {
        let mut out = Vec::new();
        ply(&mut out, &triangle()).unwrap();
        let end = out.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        assert_eq!(out.len() - end, 3 * 24 + 13);
    }
}
