//! `MarchingCubes`: the surface where a volume reaches a density, as a mesh.
//!
//! First every point of the lattice becomes a bit, inside or not; that is the only pass that reads the whole volume. Then one
//! thread walks one row of cells along x, 32 at a time, twice: it counts the row's vertices and triangles, and, with the sums
//! of all rows before it, it stores them (the rows of W. Schroeder, R. Maynard, B. Geveci, Flying Edges, 2015). Crossed edges
//! are exclusive ors of words, and their numbers are counts of bits: a vertex belongs to the point at the lower end of its
//! edge, so a thread knows the numbers of its neighbours' vertices without anyone having stored them.

use glam::DVec3;
use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::cube_table::{self, STRIDE};
use super::gradient::{facing, gradient, with_gradient};
use crate::analysis::prefix::{FAST_RADIX, scan};
use crate::shader;

/// The surface where the density, between voxel centres, is `iso`: triangles that share their vertices, counter-clockwise
/// from the side of lower density. Closed surfaces are watertight. A surface that reaches the outermost voxels is open
/// there, unless `options: (border: Black)` closes it by a layer of density 0. The first channel is the density.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct MarchingCubes {
    /// The volume.
    volume: In<Volume>,
    /// The density of the surface.
    #[default(0.5.into())]
    iso: Driven,
    /// Room for so many triangles; absent: for what smooth surfaces need, at least 262,144, if the device can hold it. A mesh
    /// that needs more is an error that says how many.
    #[schemars(range(min = 1, max = 178956970))]
    max_triangles: Option<u32>,
    /// Lengths of the volume's edges in the mesh: positions run from 0 to these.
    #[default([1.0, 1.0, 1.0])]
    extent: [f32; 3],
}

pub(super) const KIND: Kind = Kind::of::<MarchingCubes>(
    "MarchingCubes",
    Category::Volumes,
    &[
        r#"MarchingCubes(volume: "volume")"#,
        r#"MarchingCubes(volume: "fog", iso: 0.8)"#,
        r#"MarchingCubes(volume: "volume", iso: "scalar")"#,
        r#"MarchingCubes(volume: "volume", extent: (1, 0.5, 2))"#,
    ],
)
.tolerance(2e-4, 0.0);

/// Rooms that are always there: small meshes of small volumes need no thought.
const LEAST_ROOM: u64 = 1 << 18;

/// The grid of voxel centres, with a layer around it where the surface is to be closed.
struct Lattice {
    points: [u32; 3],
    pad: u32,
}

impl Lattice {
    fn new(size: [u32; 3], border: Border) -> Self {
        let pad = u32::from(border == Border::Black);
        Self { points: size.map(|n| n + 2 * pad), pad }
    }

    fn rows(&self) -> u32 {
        self.points[1] * self.points[2]
    }

    /// Words of 32 points in a row.
    fn row_words(&self) -> u32 {
        self.points[0].div_ceil(32)
    }

    /// What every pass knows.
    fn describe<'b, 'a>(&self, pass: PassBuilder<'b, 'a>) -> PassBuilder<'b, 'a> {
        pass.param("points", self.points.map(|n| n as i32)).constant("ROW_WORDS", self.row_words() as i32)
    }

    /// A pass of one thread a row.
    fn walk<'b, 'a>(&self, pass: PassBuilder<'b, 'a>, inside: ResourceId, cases: ResourceId) -> PassBuilder<'b, 'a> {
        self.describe(pass)
            .entry(Entry::Each)
            .grid(Grid::Elements([self.rows(), 1, 1]))
            .read("inside", inside, Reach::Whole)
            .read("cases", cases, Reach::Whole)
            .constant("STRIDE", STRIDE as i32)
    }

    /// Room for a mesh: vertices and triangles.
    fn room(&self, asked: Option<u32>) -> MeshType {
        let [x, y, z] = self.points.map(u64::from);
        let cells = (x - 1) * (y - 1) * (z - 1);
        let smooth = 16 * (x * y + y * z + z * x);
        let triangles = asked.map_or(smooth.max(LEAST_ROOM), u64::from).min(5 * cells).clamp(1, u64::from(u32::MAX) / 24);
        let vertices = triangles.max(LEAST_ROOM).min(3 * x * y * z);
        MeshType { max_vertices: vertices as u32, max_triangles: triangles as u32 }
    }
}

/// A walk with what both walks share.
fn with_rows(shader: &Shader) -> Shader {
    Shader::builtin(&shader.path, &format!("{}\n{}", shader.source, shader!("volumes/marching_rows").source))
}

/// As much of the room as buffers of this size hold.
fn within(room: MeshType, bytes: u64) -> MeshType {
    let most = |each: u64| u32::try_from(bytes / each).unwrap_or(u32::MAX);
    MeshType { max_vertices: room.max_vertices.min(most(24)), max_triangles: room.max_triangles.min(most(12)) }
}

impl Node for MarchingCubes {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        if self.extent.iter().all(|n| *n > 0.0) {
            return Ok(());
        }
        Err(Mistake::in_field("extent", "is no box").hint("expected three lengths above 0"))
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        // The border is known only when lowering; the layer around may need a little more.
        let lattice = Lattice::new(inputs.volume(&self.volume).size, Border::Black);
        Ok(Output::out(EdgeType::Mesh(lattice.room(self.max_triangles))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (volume, border) = (cx.input(&self.volume), cx.border());
        let (Shape::Volume(ty), EdgeType::Mesh(room)) = (cx.shape(volume), cx.output_type("out")) else {
            unreachable!("the resolver bound a volume, and `outputs` has declared a mesh")
        };
        let lattice = Lattice::new(ty.size, border);
        let room = if self.max_triangles.is_none() { within(room, cx.limits().max_binding_bytes) } else { room };
        let cases = cx.uints("cases", &cube_table::words());
        let inside = cx.intermediate("inside", Shape::uints(lattice.row_words() * lattice.rows()));
        let bits = cx.pass("inside", shader!("volumes/marching_inside"));
        lattice
            .describe(bits)
            .read_with("volume", volume, Reach::Whole, border, Filter::Nearest)
            .write("out", inside)
            .driven("iso", &self.iso)
            .constant("PAD", lattice.pad as i32)
            .add();
        let table = Shape::uints(lattice.rows());
        let (vertices, triangles) = (cx.intermediate("row_vertices", table), cx.intermediate("row_triangles", table));
        let count = cx.pass("count", with_rows(&shader!("volumes/marching_count")));
        lattice.walk(count, inside, cases).write("vertices", vertices).write("triangles", triangles).add();
        let vertex_sums = scan(cx, "vertex_sums", vertices, true, FAST_RADIX);
        let triangle_sums = scan(cx, "triangle_sums", triangles, true, FAST_RADIX);
        let parts = MeshParts {
            vertices: cx.intermediate("vertices", Shape::floats(6 * room.max_vertices)),
            triangles: cx.intermediate("triangles", Shape::uints(3 * room.max_triangles)),
            counts: cx.intermediate("counts", Shape::uints(2)),
        };
        let emit = cx.pass("emit", with_gradient(&with_rows(&shader!("volumes/marching_emit"))));
        lattice
            .walk(emit, inside, cases)
            .read_with("volume", volume, Reach::Whole, border, Filter::Linear)
            .read("vertex_sums", vertex_sums, Reach::Whole)
            .read("triangle_sums", triangle_sums, Reach::Whole)
            .write("vertices", parts.vertices)
            .write("triangles", parts.triangles)
            .driven("iso", &self.iso)
            .param("extent", self.extent)
            .constant("PAD", lattice.pad as i32)
            .add();
        cx.pass("total", shader!("volumes/marching_total"))
            .read("vertex_sums", vertex_sums, Reach::Whole)
            .read("triangle_sums", triangle_sums, Reach::Whole)
            .write("out", parts.counts)
            .add();
        cx.emit_mesh("out", parts);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (volume, iso) = (cx.volume(&self.volume), cx.driven(&self.iso));
        let lattice = Lattice::new(volume.size, cx.border);
        let [w, h, d] = lattice.points.map(i64::from);
        let pad = i64::from(lattice.pad);
        let density = |p: [i64; 3]| volume.load(p.map(|i| i - pad), cx.border)[0];
        let place = |p: [i64; 3]| -> DVec3 { std::array::from_fn(|i| ((p[i] - pad) as f64 + 0.5) / f64::from(volume.size[i])).into() };
        let grid = || (0..d).flat_map(move |z| (0..h).flat_map(move |y| (0..w).map(move |x| [x, y, z])));
        let extent = DVec3::from(self.extent.map(f64::from));
        let mut mesh = Triangles::default();
        let mut numbers = std::collections::HashMap::new();
        for p in grid() {
            for axis in 0..3 {
                let mut q = p;
                q[axis] += 1;
                let (a, b) = (density(p), density(q));
                if q[axis] == [w, h, d][axis] || (a >= iso) == (b >= iso) {
                    continue;
                }
                let vertex = place(p).lerp(place(q), ((iso - a) / (b - a)).clamp(0.0, 1.0));
                let normal = facing(gradient(volume, vertex, cx.border) / extent);
                let outwards = if a > b { DVec3::AXES[axis] } else { -DVec3::AXES[axis] };
                numbers.insert((p, axis), mesh.vertices.len() as u32);
                mesh.vertices.push((vertex * extent).to_array());
                mesh.normals.push(if normal == DVec3::ZERO { outwards } else { normal }.to_array());
            }
        }
        for [x, y, z] in grid().filter(|p| p[0] + 1 < w && p[1] + 1 < h && p[2] + 1 < d) {
            let corner = |c: usize| [x + (c & 1) as i64, y + (c >> 1 & 1) as i64, z + (c >> 2) as i64];
            let case = (0..8).fold(0, |case, c| case | usize::from(density(corner(c)) >= iso) << c);
            let numbered = cube_table::triangles(case).into_iter().map(|t| t.map(|e| numbers[&(corner(e.corner), e.axis)]));
            mesh.triangles.extend(numbered);
        }
        vec![Tensor::Mesh(mesh)]
    }
}
