//! A test bench: a device, and graphs run on it beside their twins.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use pipe_gpu::{Choice, Device, Executor, RunOptions};
use pipe_graph::diagnostic::{Diagnostics, Sources};
use pipe_graph::document::parse;
use pipe_graph::graph::Graph;
use pipe_graph::node::{Kind, Loader, Registry, TableFile};
use pipe_graph::pass::Limits;
use pipe_graph::reference::{Tensor, evaluate};
use pipe_graph::resolve::{Request, resolve};
use pipe_graph::types::{EdgeType, Element, ImageType, VolumeType};
use pipe_plan::lower::Rim;
use pipe_plan::{Options, Plan};

use crate::scattered;
use crate::source::{self, bytes};

const TEST_KINDS: &[Kind] = &[source::KIND, scattered::KIND];

/// The library with what only tests need.
pub const REGISTRY: Registry = Registry::new(&[TEST_KINDS]);

/// The kind of this name, of the library or of the tests.
fn registry() -> Registry {
    static ALL: std::sync::OnceLock<Vec<Kind>> = std::sync::OnceLock::new();
    static GROUPS: std::sync::OnceLock<Vec<&'static [Kind]>> = std::sync::OnceLock::new();
    let all = ALL.get_or_init(|| pipe_nodes::REGISTRY.iter().chain(REGISTRY.iter()).copied().collect());
    Registry::new(GROUPS.get_or_init(|| vec![all.as_slice()]))
}

/// A world without files.
pub struct NoFiles;

impl Loader for NoFiles {
    fn text(&self, path: &Path, _: usize) -> Result<String, String> {
        std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
    }
    fn image(&self, path: &Path) -> Result<ImageType, String> {
        Err(format!("{}: no such file", path.display()))
    }
    fn volume(&self, path: &Path) -> Result<VolumeType, String> {
        Err(format!("{}: no such file", path.display()))
    }
    fn table(&self, path: &Path) -> Result<TableFile, String> {
        Err(format!("{}: no such file", path.display()))
    }
}

/// Resolves a graph text; the rendered mistakes otherwise.
pub fn compile(text: &str, inputs: &[(&str, EdgeType)]) -> Result<Graph, String> {
    compile_with(text, inputs, &[])
}

/// Resolves a graph text as with `--set`; the rendered mistakes otherwise.
pub fn compile_with(text: &str, inputs: &[(&str, EdgeType)], settings: &[(&str, &str)]) -> Result<Graph, String> {
    let (mut sources, mut diagnostics) = (Sources::default(), Diagnostics::default());
    let registry = registry();
    let document = parse(Path::new("test.ron"), text, &registry, &mut sources, &mut diagnostics);
    let request = Request {
        inputs: inputs.iter().map(|(n, t)| ((*n).to_owned(), *t)).collect(),
        settings: settings.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect(),
        ..Request::default()
    };
    let graph = document.and_then(|d| resolve(&d, &request, &registry, &NoFiles, &mut sources, &mut diagnostics));
    match graph {
        Some(graph) if !diagnostics.has_errors() => Ok(graph),
        _ => Err(diagnostics.render(&sources, false)),
    }
}

/// Plans a graph.
pub fn plan(graph: &Graph, limits: &Limits, options: &Options) -> Result<Plan, String> {
    pipe_plan::plan_graph(graph, &Rim::default(), limits, options, &|_| true).map_err(|e| e.to_string())
}

/// What runs longer will not end.
const PATIENCE: Duration = Duration::from_secs(300);

/// The values of a graph's outputs by name.
pub type Values = HashMap<String, Vec<f64>>;

/// A device with its executor.
pub struct Bench {
    executor: Executor,
}

impl Default for Bench {
    fn default() -> Self {
        Self::new()
    }
}

impl Bench {
    /// Opens the device that `PIPE_DEVICE` names, or the best one. Tests need a device: there is no skipping.
    pub fn new() -> Self {
        let choice = Choice::parse(&std::env::var("PIPE_DEVICE").unwrap_or_default());
        let device = Device::open(&choice).unwrap_or_else(|e| panic!("{e}"));
        Self { executor: Executor::new(device, None) }
    }

    /// What plans for the device may use.
    pub fn limits(&self) -> Limits {
        self.executor.device().limits()
    }

    /// Runs a plan of a graph.
    pub fn run(&mut self, graph: &Graph, plan: Plan, inputs: &dyn Fn(&str) -> Tensor) -> Result<Values, String> {
        let held: Vec<(String, Vec<u8>)> = graph.inputs().map(|(n, ty)| (n.to_owned(), bytes(&inputs(n), &ty))).collect();
        let given: HashMap<&str, &[u8]> = held.iter().map(|(n, b)| (n.as_str(), b.as_slice())).collect();
        // Every graph is a first frame.
        self.executor.forget();
        let prepared = self.executor.prepare(Arc::new(plan)).map_err(|e| e.to_string())?;
        let outputs = self
            .executor
            .run(&prepared, &given, &RunOptions { timeout: Some(PATIENCE), ..RunOptions::default() })
            .map_err(|e| e.to_string())?;
        self.executor.release(prepared);
        let mut values = Values::new();
        for (name, value) in graph.outputs() {
            if let EdgeType::Mesh(_) = graph.ty(value) {
                values.insert(name.to_owned(), mesh(&|part| outputs.fetched[&format!("{name}.{part}")].clone()));
                continue;
            }
            let Some(bytes) = outputs.fetched.get(name) else { continue };
            let words = bytes.chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]);
            let list: Vec<f64> = match graph.ty(value) {
                EdgeType::Table(t) if t.element == Element::U32 => words.map(|w| f64::from(u32::from_le_bytes(w))).collect(),
                EdgeType::Scalar(t) => words.take(t.components as usize).map(|w| f64::from(f32::from_le_bytes(w))).collect(),
                _ => words.map(|w| f64::from(f32::from_le_bytes(w))).collect(),
            };
            values.insert(name.to_owned(), list);
        }
        Ok(values)
    }

    /// Plans and runs a graph.
    pub fn gpu(&mut self, graph: &Graph, inputs: &dyn Fn(&str) -> Tensor) -> Result<Values, String> {
        let plan = plan(graph, &self.limits(), &Options::default())?;
        self.run(graph, plan, inputs)
    }
}

/// The filled part of a mesh: position and normal of every vertex, then the vertices of every triangle.
fn mesh(part: &dyn Fn(&str) -> Vec<u8>) -> Vec<f64> {
    let words = |name: &str| part(name).chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect::<Vec<_>>();
    let counts = words("counts");
    let vertices = words("vertices").into_iter().take(6 * counts[0] as usize).map(|w| f64::from(f32::from_bits(w)));
    vertices.chain(words("triangles").into_iter().take(3 * counts[1] as usize).map(f64::from)).collect()
}

/// A graph's outputs in double precision.
pub fn reference(graph: &Graph, inputs: &dyn Fn(&str) -> Tensor) -> Values {
    let all = evaluate(graph, inputs);
    let flat = |t: &Tensor| -> Vec<f64> {
        match t {
            Tensor::Image(r) => r.pixels.iter().flat_map(|p| p[..r.channels as usize].to_vec()).collect(),
            Tensor::Volume(b) => b.voxels.iter().flat_map(|p| p[..b.channels as usize].to_vec()).collect(),
            Tensor::Table(t) | Tensor::Scalar(t) => t.clone(),
            Tensor::Mesh(m) => {
                let vertices = m.vertices.iter().zip(&m.normals).flat_map(|(p, n)| p.iter().chain(n)).copied();
                vertices.chain(m.triangles.iter().flatten().map(|i| f64::from(*i))).collect()
            }
        }
    };
    graph.outputs().filter_map(|(name, value)| Some((name.to_owned(), flat(all.get(&value)?)))).collect()
}
