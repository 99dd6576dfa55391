//! The twins: every node once more on the CPU, in double precision, for tests and for `pipe doctor`.
//!
//! Values are plain arrays; nothing is tiled, fused or clever, so that the code can be read beside the formula.

use std::collections::HashMap;

use crate::field::{Accepts, Driven, Image, In, Mesh, Scalar, Table, Volume};
use crate::graph::{Graph, Times, ValueRef, Work};
use crate::node::FileSource;
use crate::pass::Border;

/// An image in double precision. A pixel always has four components: grey (v, v, v, 1), a pair (u, v, 0, 1).
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    /// Width and height.
    pub size: [u32; 2],
    /// 1, 2 or 4.
    pub channels: u8,
    /// Rows from the top.
    pub pixels: Vec<[f64; 4]>,
}

/// What is left of a value stored in so many channels.
pub fn narrow(v: [f64; 4], channels: u8) -> [f64; 4] {
    match channels {
        1 => [v[0], v[0], v[0], 1.0],
        2 => [v[0], v[1], 0.0, 1.0],
        _ => v,
    }
}

/// The index that a border policy reads for `i` in a row of `n`; `None` is black.
pub fn border_index(i: i64, n: u32, border: Border) -> Option<usize> {
    let n = i64::from(n);
    Some(match border {
        Border::Clamp => i.clamp(0, n - 1),
        Border::Repeat => i.rem_euclid(n),
        Border::Mirror => {
            let m = i.rem_euclid(2 * n);
            m.min(2 * n - 1 - m)
        }
        Border::Black if (0..n).contains(&i) => i,
        Border::Black => return None,
    } as usize)
}

impl Raster {
    /// An image whose pixel (x, y) is `f(x, y)`.
    pub fn from_fn(size: [u32; 2], channels: u8, mut f: impl FnMut(i64, i64) -> [f64; 4]) -> Self {
        let mut pixels = Vec::with_capacity(size[0] as usize * size[1] as usize);
        for y in 0..i64::from(size[1]) {
            for x in 0..i64::from(size[0]) {
                pixels.push(narrow(f(x, y), channels));
            }
        }
        Self { size, channels, pixels }
    }

    /// The pixel at (x, y), inside.
    pub fn at(&self, x: i64, y: i64) -> [f64; 4] {
        self.pixels[y as usize * self.size[0] as usize + x as usize]
    }

    /// The pixel at (x, y), anywhere. Black outside is (0, 0, 0, 0) in every number of channels.
    pub fn load(&self, x: i64, y: i64, border: Border) -> [f64; 4] {
        match (border_index(x, self.size[0], border), border_index(y, self.size[1], border)) {
            (Some(x), Some(y)) => self.pixels[y * self.size[0] as usize + x],
            _ => [0.0; 4],
        }
    }

    /// Bilinear sample at (x, y) in pixels, centres at +0.5.
    pub fn sample(&self, x: f64, y: f64, border: Border) -> [f64; 4] {
        let (x, y) = (x - 0.5, y - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let at = |dx: i64, dy: i64| self.load(x0 as i64 + dx, y0 as i64 + dy, border);
        let (a, b, c, d) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1));
        std::array::from_fn(|i| (a[i] * (1.0 - fx) + b[i] * fx) * (1.0 - fy) + (c[i] * (1.0 - fx) + d[i] * fx) * fy)
    }

    /// Every pixel through `f`.
    #[must_use]
    pub fn map(&self, channels: u8, mut f: impl FnMut([f64; 4]) -> [f64; 4]) -> Self {
        let pixels = self.pixels.iter().map(|p| narrow(f(*p), channels)).collect();
        Self { size: self.size, channels, pixels }
    }
}

/// Rec.709 luminance of a linear colour: Y = 0.2126 R + 0.7152 G + 0.0722 B (ITU-R BT.709-6).
pub fn luminance(c: [f64; 4]) -> f64 {
    0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
}

/// A volume in double precision, x fastest, then y, then z.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Voxels along x, y, z.
    pub size: [u32; 3],
    /// 1 or 4.
    pub channels: u8,
    /// Voxels.
    pub voxels: Vec<[f64; 4]>,
}

impl Block {
    /// A volume whose voxel (x, y, z) is `f(x, y, z)`.
    pub fn from_fn(size: [u32; 3], channels: u8, mut f: impl FnMut(i64, i64, i64) -> [f64; 4]) -> Self {
        let mut voxels = Vec::with_capacity(size.iter().map(|n| *n as usize).product());
        for z in 0..i64::from(size[2]) {
            for y in 0..i64::from(size[1]) {
                for x in 0..i64::from(size[0]) {
                    voxels.push(narrow(f(x, y, z), channels));
                }
            }
        }
        Self { size, channels, voxels }
    }

    /// The voxel at (x, y, z), anywhere.
    pub fn load(&self, at: [i64; 3], border: Border) -> [f64; 4] {
        let index: [_; 3] = std::array::from_fn(|i| border_index(at[i], self.size[i], border));
        match index {
            [Some(x), Some(y), Some(z)] => self.voxels[(z * self.size[1] as usize + y) * self.size[0] as usize + x],
            _ => [0.0; 4],
        }
    }

    /// Trilinear sample at a point of the unit cube that the volume fills.
    pub fn sample(&self, at: [f64; 3], border: Border) -> [f64; 4] {
        let place: [f64; 3] = std::array::from_fn(|i| at[i] * f64::from(self.size[i]) - 0.5);
        let mut sum = [0.0; 4];
        for corner in 0..8_i64 {
            let far = |axis: usize| corner >> axis & 1;
            let fraction = |axis: usize| place[axis] - place[axis].floor();
            let weight: f64 = (0..3).map(|i| if far(i) == 1 { fraction(i) } else { 1.0 - fraction(i) }).product();
            let voxel = self.load(std::array::from_fn(|i| place[i].floor() as i64 + far(i)), border);
            (0..4).for_each(|c| sum[c] += weight * voxel[c]);
        }
        sum
    }
}

/// A triangle mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Triangles {
    /// Positions in the unit cube.
    pub vertices: Vec<[f64; 3]>,
    /// Unit normals, one a vertex.
    pub normals: Vec<[f64; 3]>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

/// The value of an edge.
#[derive(Debug, Clone, PartialEq)]
pub enum Tensor {
    /// An image.
    Image(Raster),
    /// A volume.
    Volume(Block),
    /// A table.
    Table(Vec<f64>),
    /// 1 to 4 numbers.
    Scalar(Vec<f64>),
    /// A mesh.
    Mesh(Triangles),
}

/// What arrives at a node whose twin is computed.
#[derive(Debug)]
pub struct Reference<'a> {
    /// One value for each of the node's edges.
    pub inputs: &'a [&'a Tensor],
    /// The content of the file that the node asked for.
    pub file: Option<&'a Tensor>,
    /// Border policy of the node.
    pub border: Border,
    /// `options.filter` of the node.
    pub filter: crate::pass::Filter,
    /// The user's seed.
    pub seed: u64,
}

impl<'a> Reference<'a> {
    /// The value at any port.
    pub fn input<T: Accepts>(&self, port: &In<T>) -> &'a Tensor {
        self.inputs[port.edge.0 as usize]
    }

    /// The image at a port.
    pub fn image(&self, port: &In<Image>) -> &'a Raster {
        match self.input(port) {
            Tensor::Image(raster) => raster,
            other => unreachable!("not an image: {other:?}"),
        }
    }

    /// The volume at a port.
    pub fn volume(&self, port: &In<Volume>) -> &'a Block {
        match self.input(port) {
            Tensor::Volume(block) => block,
            other => unreachable!("not a volume: {other:?}"),
        }
    }

    /// The table at a port.
    pub fn table(&self, port: &In<Table>) -> &'a [f64] {
        match self.input(port) {
            Tensor::Table(values) => values,
            other => unreachable!("not a table: {other:?}"),
        }
    }

    /// The scalar at a port.
    pub fn scalar(&self, port: &In<Scalar>) -> &'a [f64] {
        match self.input(port) {
            Tensor::Scalar(values) => values,
            other => unreachable!("not a scalar: {other:?}"),
        }
    }

    /// The mesh at a port.
    pub fn mesh(&self, port: &In<Mesh>) -> &'a Triangles {
        match self.input(port) {
            Tensor::Mesh(triangles) => triangles,
            other => unreachable!("not a mesh: {other:?}"),
        }
    }

    /// A number or the first component of a scalar.
    pub fn driven(&self, value: &Driven) -> f64 {
        match value {
            Driven::Value(v) => f64::from(*v),
            Driven::Scalar(port) => self.scalar(port)[0],
        }
    }
}

/// Computes a whole graph in double precision. `input` gives graph inputs by name and files by
/// [`FileSource`](crate::node::FileSource) path.
///
/// Iterations run as they are written; `Feedback` has its initial value.
pub fn evaluate(graph: &Graph, input: &dyn Fn(&str) -> Tensor) -> HashMap<ValueRef, Tensor> {
    region(graph, input, &|_, _| unreachable!("states stand in bodies only"))
}

fn region(graph: &Graph, input: &dyn Fn(&str) -> Tensor, given: &dyn Fn(bool, usize) -> Tensor) -> HashMap<ValueRef, Tensor> {
    let mut values: HashMap<ValueRef, Tensor> = HashMap::new();
    for (node, instance) in graph.iter() {
        let out = match &instance.work {
            Work::Input => vec![input(&instance.name)],
            Work::State(n) => vec![given(true, *n)],
            Work::Capture(n) => vec![given(false, *n)],
            Work::Feedback { .. } => vec![values[&instance.inputs[0]].clone()],
            Work::Node(work) => {
                let file = work.file().map(|f| match f {
                    FileSource::Image(path) | FileSource::Volume(path) => input(&path),
                });
                let mut inputs: Vec<Tensor> = instance.inputs.iter().map(|v| values[v].clone()).collect();
                let mut out = Vec::new();
                for _ in 0..instance.options.repeat.unwrap_or(1) {
                    if let Some(last) = out.first() {
                        inputs[0] = Tensor::clone(last);
                    }
                    out = work.reference(&Reference {
                        inputs: &inputs.iter().collect::<Vec<_>>(),
                        file: file.as_ref(),
                        border: instance.options.border,
                        filter: instance.options.filter,
                        seed: 0,
                    });
                }
                out
            }
            Work::Iterate(iteration) => {
                let states = instance.outputs.len();
                let mut state: Vec<Tensor> = instance.inputs[..states].iter().map(|v| values[v].clone()).collect();
                let (times, until) = match iteration.times {
                    Times::Fixed(n) => (n, None),
                    Times::Until { value, limit, every, max } => (max, Some((value, limit, every))),
                };
                for i in 0..times {
                    let inside = region(&iteration.body, input, &|is_state, n| {
                        if is_state { state[n].clone() } else { values[&instance.inputs[states + n]].clone() }
                    });
                    state = iteration.next.iter().map(|v| inside[v].clone()).collect();
                    if let Some((value, limit, every)) = until
                        && (i + 1) % every == 0
                        && matches!(&inside[&value], Tensor::Scalar(s) if s[0] < f64::from(limit))
                    {
                        break;
                    }
                }
                state
            }
        };
        for (port, value) in out.into_iter().enumerate() {
            values.insert(ValueRef { node, port }, value);
        }
    }
    values
}
