//! Pictures through a graph: decode, plan, execute, encode.
//!
//! The device is opened while inputs are decoded. Outputs are written only when everything has run, each to a
//! temporary file that is renamed at the end; so a run that fails leaves every old file as it was.

use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use indexmap::IndexMap;
use pipe_gpu::{Choice, Device, Executor, Outputs, Prepared, RunOptions};
use pipe_graph::graph::{Graph, Instance, Work};
use pipe_graph::node::ReadbackFile;
use pipe_graph::pass::{Border, Limits};
use pipe_graph::resolve::Request;
use pipe_graph::types::{EdgeKind, EdgeType, Element, ImageType, VolumeType};
use pipe_io::mesh::Mesh;
use pipe_io::sequence::Pattern;
use pipe_io::table::Table;
use pipe_io::volume::{Volume, VolumeHeader, Voxel};
use pipe_io::{Animation, Channels, Metadata, Picture, ReadOptions, RowWriter, Target, WriteBehind, WriteOptions};
use pipe_plan::lower::{Rim, readback_name};
use pipe_plan::{Options, Plan};

use crate::decode::{self, Decoder, Distant};
use crate::exchange::Pictures;
use crate::project::{Project, World};
use crate::{Failure, forms, readback};

/// Where an output goes.
#[derive(Debug, Clone)]
pub enum Destination {
    /// An image file or stream.
    Image(Target),
    /// A table or a scalar: csv, json, npy, svg, png.
    Data(PathBuf),
}

/// What to run on what.
#[derive(Debug, Clone)]
pub struct Job {
    /// Path of a graph, or the bare name of a preset.
    pub graph: String,
    /// Files for graph inputs, `file.exr#layer`, by name.
    pub inputs: IndexMap<String, String>,
    /// Files for graph outputs, by name.
    pub outputs: IndexMap<String, String>,
    /// Files for values of private nodes, by `node` or `node.port`.
    pub dumps: IndexMap<String, String>,
    /// `--set`
    pub settings: Vec<(String, String)>,
    /// How inputs are read.
    pub read: ReadOptions,
    /// How outputs are written.
    pub write: WriteOptions,
    /// Whether passes may be fused.
    pub fuse: bool,
    /// Bytes that may be alive on the device.
    pub budget: Option<u64>,
    /// `--seed`
    pub seed: u64,
    /// Bounds the GPU work.
    pub timeout: Option<Duration>,
    /// Measure every pass.
    pub profile: bool,
    /// Let an output overwrite an input.
    pub force: bool,
    /// The frame, as `frame` in expressions.
    pub frame: f64,
    /// Frames a second: `time` in expressions, and the speed of moving pictures.
    pub rate: f64,
    /// Frames that this session ran before, for `Feedback`.
    pub frames_before: u32,
    /// Keep results on the device, as far as half of the budget goes, and leave out what a later run of the session
    /// finds there.
    pub keep: bool,
}

impl Job {
    /// A job without files.
    pub fn new(graph: &str) -> Self {
        Self {
            graph: graph.to_owned(),
            inputs: IndexMap::new(),
            outputs: IndexMap::new(),
            dumps: IndexMap::new(),
            settings: Vec::new(),
            read: ReadOptions::default(),
            write: WriteOptions::default(),
            fuse: true,
            budget: None,
            seed: 0,
            timeout: None,
            profile: false,
            force: false,
            frame: 1.0,
            rate: 24.0,
            frames_before: 0,
            keep: false,
        }
    }

    /// Binds a file to a graph input.
    pub fn bind_input(&mut self, name: &str, file: &str) {
        self.inputs.insert(name.to_owned(), file.to_owned());
    }

    /// Binds a file to a graph output. Its ending must be that of a known format.
    pub fn bind_output(&mut self, name: &str, file: &str) -> Result<(), Failure> {
        self.outputs.insert(name.to_owned(), file.to_owned());
        Ok(())
    }
}

/// Time of each stage, milliseconds.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct Wall {
    /// Reading and decoding the inputs (the device opens meanwhile).
    pub decode: f64,
    /// Checking and planning, compiling pipelines.
    pub plan: f64,
    /// Bytes to the device.
    pub upload: f64,
    /// Passes.
    pub compute: f64,
    /// Bytes from the device.
    pub readback: f64,
    /// Encoding and writing the outputs.
    pub encode: f64,
    /// All of it.
    pub total: f64,
}

/// What a run has to say.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// The device.
    pub device: String,
    /// Size of the first image input or output.
    pub size: Vec<u32>,
    /// Values of readbacks by node.
    pub readbacks: serde_json::Map<String, serde_json::Value>,
    /// Wall time by stage.
    pub wall: Wall,
    /// GPU time by pass, when it was measured.
    pub passes: IndexMap<String, f64>,
    /// How many passes ran.
    pub passes_run: usize,
    /// How many did not, since the device still held what they make.
    pub passes_kept: usize,
    /// Bytes that the plan's slots take.
    pub peak_bytes: u64,
    /// Warnings about the graph, rendered.
    pub warnings: String,
    /// The plan that ran.
    pub plan: Option<Arc<Plan>>,
}

impl Report {
    /// `--stats`: `{device, size, readbacks, timings, passes, passes_run, passes_kept, peak_bytes}`.
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::json!({
            "device": self.device,
            "size": self.size,
            "readbacks": self.readbacks,
            "timings": self.wall,
            "passes": self.passes,
            "passes_run": self.passes_run,
            "passes_kept": self.passes_kept,
            "peak_bytes": self.peak_bytes,
        })
    }
}

/// A decoded input.
pub enum Decoded {
    /// An image.
    Picture(Picture),
    /// An image so large that its rows are better decoded when they are needed.
    Distant(Distant),
    /// A volume.
    Volume(Volume),
    /// A table.
    Table(Table),
}

impl Decoded {
    fn bytes(&self) -> Cow<'_, [u8]> {
        match self {
            Self::Picture(p) => Cow::Borrowed(&p.bytes),
            Self::Distant(_) => Cow::Borrowed(&[]),
            Self::Volume(v) => Cow::Borrowed(&v.bytes),
            Self::Table(Table::Float(v)) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Self::Table(Table::Uint(v)) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
        }
    }

    fn ty(&self) -> EdgeType {
        match self {
            Self::Picture(p) => EdgeType::Image(ImageType::new([p.width, p.height], forms::image_channels(p.channels))),
            Self::Distant(d) => {
                let header = &d.header;
                EdgeType::Image(ImageType::new([header.width, header.height], forms::image_channels(header.channels)))
            }
            Self::Volume(v) => EdgeType::Volume(forms::volume_type(&v.header)),
            Self::Table(Table::Float(v)) => EdgeType::table(v.len() as u32, Element::F32),
            Self::Table(Table::Uint(v)) => EdgeType::table(v.len() as u32, Element::U32),
        }
    }
}

/// All inputs of one frame, by graph input and by [`file_name`] of files that nodes read.
pub type Inputs = IndexMap<String, Arc<Decoded>>;

/// What comes out of a run before it is written.
pub struct Finished {
    images: Vec<(Target, Picture)>,
    /// Files that all rows were given to, and that appear at the end.
    written: Vec<WriteBehind>,
    volumes: Vec<(PathBuf, Volume)>,
    meshes: Vec<(PathBuf, Mesh)>,
    data: Vec<(ReadbackFile, Vec<u8>)>,
    /// What there is to say.
    pub report: Report,
    write: WriteOptions,
}

impl Finished {
    /// Puts the frame's number into the paths of readbacks; those of outputs have theirs.
    pub(crate) fn at_frame(mut self, frame: u32) -> Result<Self, Failure> {
        for (file, _) in &mut self.data {
            if let Some(pattern) = Pattern::parse(&file.path)? {
                file.path = pattern.name(frame);
            }
        }
        Ok(self)
    }

    /// Writes every output. Nothing was written before.
    pub fn write(self) -> Result<Report, Failure> {
        self.write_into(&mut HashMap::new())
    }

    /// Writes every output: pictures whose target is one of these moving pictures become its next frame.
    pub fn write_into(mut self, moving: &mut HashMap<Target, Animation>) -> Result<Report, Failure> {
        let started = Instant::now();
        for (target, picture) in &self.images {
            if let Some(animation) = moving.get_mut(target) {
                animation.push(picture)?;
                continue;
            }
            let options = WriteOptions { channels: Some(picture.channels), ..self.write.clone() };
            pipe_io::write(target, picture, &options)?;
        }
        for file in self.written {
            file.finish()?;
        }
        for (path, volume) in &self.volumes {
            pipe_io::volume::write(path, volume)?;
        }
        for (path, mesh) in &self.meshes {
            pipe_io::mesh::write(path, mesh)?;
        }
        for (file, bytes) in &self.data {
            readback::write(file, bytes)?;
        }
        self.report.wall.encode = millis(started);
        self.report.wall.total += self.report.wall.encode;
        Ok(self.report)
    }
}

/// A device, with what it keeps between frames.
pub struct Session {
    executor: Executor,
    prepared: Option<Prepared>,
    inputs: Decoder,
    /// Files that nodes read.
    files: Decoder,
    seen: BTreeSet<PathBuf>,
}

impl Session {
    /// Opens a device; `cache` is a folder for compiled pipelines.
    pub fn open(choice: &Choice, cache: Option<&Path>) -> Result<Self, Failure> {
        let executor = Executor::new(Device::open(choice)?, cache);
        Ok(Self { executor, prepared: None, inputs: Decoder::default(), files: Decoder::default(), seen: BTreeSet::new() })
    }

    /// The files that the last run looked at, whether it succeeded or not: the graph, what it includes, inputs.
    pub fn files(&self) -> &BTreeSet<PathBuf> {
        &self.seen
    }

    /// The device's name.
    pub fn device_name(&self) -> &str {
        self.executor.device().name()
    }

    /// What plans for the device may use.
    pub fn limits(&self) -> Limits {
        self.executor.device().limits()
    }

    /// Measured bandwidth of copying an image of this size on the device, GB/s.
    pub fn copy_bandwidth(&mut self, size: [u32; 2]) -> Result<f64, Failure> {
        Ok(pipe_gpu::probe::copy_bandwidth(&mut self.executor, size)?)
    }

    /// Runs a job from files to files.
    pub fn run(&mut self, job: &Job) -> Result<Report, Failure> {
        let started = Instant::now();
        self.seen = BTreeSet::from([PathBuf::from(&job.graph)]);
        let kinds = input_kinds(&mut Project::open(&job.graph)?);
        // An input that is overwritten changes because of the run.
        let kept = job.inputs.iter().filter(|(_, file)| job.outputs.values().all(|out| out != *file));
        self.seen.extend(kept.filter_map(|(name, file)| decode::path(file, *kinds.get(name)?)));
        let inputs = self.inputs.inputs(job, &kinds)?;
        let decoded = millis(started);
        let mut finished = self.execute(job, &inputs, None, None)?;
        finished.report.wall.decode = decoded;
        finished.report.wall.total += decoded;
        finished.write()
    }

    /// Runs a job on decoded inputs; nothing is written yet.
    pub fn execute(
        &mut self,
        job: &Job,
        inputs: &Inputs,
        cancel: Option<&AtomicBool>,
        progress: Option<&(dyn Fn(u32, u32) + Sync)>,
    ) -> Result<Finished, Failure> {
        let started = Instant::now();
        let mut project = Project::open(&job.graph)?;
        let world = World::new(job.read);
        let request = request(job, inputs);
        let graph = project.resolve(&request, &world);
        self.seen.extend(world.files());
        let Some(graph) = graph else { return Err(project.failure(false)) };
        let mut files = self.files.files_of(&graph, &job.read, job.budget)?;
        let (rim, outputs) = rim(job, &graph, inputs, &files)?;
        let plan = Arc::new(make_plan(&graph, &rim, &self.limits(), job)?);
        self.prepare(&plan)?;
        files.extend(inputs.iter().map(|(name, input)| (name.clone(), input.clone())));
        let planned = millis(started);

        let options = RunOptions { timeout: job.timeout, profile: job.profile, cancel, progress, keep: job.keep };
        let (mut ran, mut filled) = self.launch(job, &plan, &outputs, files, &options)?;

        let mut report = Report {
            device: self.device_name().to_owned(),
            size: first_size(&graph),
            warnings: project.render(false),
            peak_bytes: plan.peak_bytes,
            passes: std::mem::take(&mut ran.timings.passes),
            passes_run: ran.timings.passes_run,
            passes_kept: ran.timings.passes_kept,
            ..Report::default()
        };
        report.wall.plan = planned;
        report.wall.upload = ran.timings.upload_ms;
        report.wall.compute = ran.timings.compute_ms;
        report.wall.readback = ran.timings.readback_ms;
        report.wall.total = millis(started);
        report.plan = Some(plan);

        let mut data = Vec::new();
        for (name, file) in readbacks(&graph) {
            let Some(bytes) = ran.fetched.shift_remove(&name) else { continue };
            let shown = name.trim_end_matches(":readback").to_owned();
            report.readbacks.insert(shown, readback::to_json(&file, &bytes));
            if !file.path.is_empty() {
                data.push((file, bytes));
            }
        }
        let (mut images, mut volumes, mut meshes, mut written) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for output in outputs {
            if let Some(file) = filled.remove(&output.name) {
                written.push(file);
                continue;
            }
            if let Packed::Mesh(path) = output.to {
                let mut part = |part: &str| ran.fetched.shift_remove(&format!("{}.{part}", output.name)).unwrap_or_default();
                let mesh = readback::mesh(&output.name, &part("vertices"), &part("triangles"), &part("counts"))?;
                meshes.push((path, mesh));
                continue;
            }
            let Some(bytes) = ran.fetched.shift_remove(&output.name) else { continue };
            match output.to {
                Packed::Image { target, form, size } => {
                    let metadata = output.metadata.unwrap_or_default();
                    images.push((target, form.picture(size[0], size[1], bytes, metadata)));
                }
                Packed::Volume { path, ty, spacing, voxel } => {
                    volumes.push((path, Volume::of_bytes(ty.size, ty.channels, spacing, bytes, voxel)));
                }
                Packed::Mesh(_) => unreachable!("taken above"),
                Packed::Data(file) => data.push((file, bytes)),
            }
        }
        Ok(Finished { images, written, volumes, meshes, data, report, write: job.write.clone() })
    }

    /// Runs the prepared plan. Outputs that are made tile by tile go straight into their files, which are answered.
    fn launch(
        &mut self,
        job: &Job,
        plan: &Plan,
        outputs: &[Output],
        mut inputs: Inputs,
        options: &RunOptions<'_>,
    ) -> Result<(Outputs, HashMap<String, WriteBehind>), Failure> {
        // What is needed whole is decoded whole.
        for (name, decoded) in &mut inputs {
            if let (true, Decoded::Distant(distant)) = (plan.uploads.iter().any(|u| u.name == *name), &**decoded) {
                *decoded = Arc::new(Decoded::Picture(distant.picture()?));
            }
        }
        let held: HashMap<&str, Cow<'_, [u8]>> = inputs.iter().map(|(n, d)| (n.as_str(), d.bytes())).collect();
        let given: HashMap<&str, &[u8]> = held.iter().map(|(n, b)| (*n, b.as_ref())).collect();
        let mut pictures = Pictures::of(&inputs, plan)?;
        for fetch in plan.tilings().filter_map(|t| t.tiles.first()).flat_map(|t| &t.fetches) {
            let image = outputs.iter().find(|o| o.name == fetch.name).and_then(|o| match &o.to {
                Packed::Image { target, form, size } if !target.format.moves() => Some((target, form, size, &o.metadata)),
                _ => None,
            });
            let file = image.filter(|_| fetch.plane == 0).map(|(target, form, [w, h], metadata)| {
                let picture = form.picture(*w, *h, Vec::new(), metadata.clone().unwrap_or_default());
                let write = WriteOptions { channels: Some(picture.channels), ..job.write.clone() };
                RowWriter::create(target, &picture, &write).map(RowWriter::behind)
            });
            pictures.collect(&fetch.name, file.transpose()?);
        }
        let prepared = self.prepared.as_ref().expect("a plan is prepared before it runs");
        let mut ran = self.executor.run_through(prepared, &given, &mut pictures, options)?;
        let arrived = pictures.arrived();
        ran.fetched.extend(arrived.bytes);
        Ok((ran, arrived.files))
    }

    fn prepare(&mut self, plan: &Arc<Plan>) -> Result<(), Failure> {
        if let Some(prepared) = &mut self.prepared
            && self.executor.update(prepared, plan)?
        {
            return Ok(());
        }
        if let Some(old) = self.prepared.take() {
            self.executor.release(old);
        }
        self.prepared = Some(self.executor.prepare(plan.clone())?);
        Ok(())
    }
}

fn millis(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

/// The kinds of a graph's inputs, by name.
pub fn input_kinds(project: &mut Project) -> HashMap<String, EdgeKind> {
    let inputs = project.document.iter().flat_map(|d| &d.inputs);
    inputs.map(|i| (i.name.value.clone(), i.kind)).collect()
}

/// What the resolver must know of a job.
pub fn request(job: &Job, inputs: &Inputs) -> Request {
    let spacing = |(name, value): (&String, &Arc<Decoded>)| match &**value {
        Decoded::Volume(volume) => Some((name.clone(), volume.header.spacing)),
        _ => None,
    };
    Request {
        inputs: inputs.iter().map(|(name, value)| (name.clone(), value.ty())).collect(),
        spacings: inputs.iter().filter_map(spacing).collect(),
        assumed: None,
        settings: job.settings.clone(),
        frame: job.frame,
        time: (job.frame - 1.0) / job.rate,
    }
}

/// A fetched output on its way to a file.
struct Output {
    name: String,
    to: Packed,
    metadata: Option<Metadata>,
}

enum Packed {
    Image { target: Target, form: pipe_io::Form, size: [u32; 2] },
    Volume { path: PathBuf, ty: VolumeType, spacing: [f32; 3], voxel: Voxel },
    Mesh(PathBuf),
    Data(ReadbackFile),
}

/// In which form everything crosses the rim.
fn rim(job: &Job, graph: &Graph, inputs: &Inputs, files: &Inputs) -> Result<(Rim, Vec<Output>), Failure> {
    let mut rim = Rim { frames_before: job.frames_before, seed: job.seed, ..Rim::default() };
    for (name, value) in inputs.iter().chain(files) {
        match &**value {
            Decoded::Picture(p) => drop(rim.inputs.insert(name.clone(), forms::of_picture(p))),
            Decoded::Distant(d) => drop(rim.inputs.insert(name.clone(), forms::of_header(&d.header, d.layout))),
            Decoded::Volume(v) => drop(rim.volumes.insert(name.clone(), forms::of_volume(&v.header))),
            Decoded::Table(_) => {}
        }
    }
    let all_inputs = || inputs.values().chain(files.values());
    let metadata = || {
        all_inputs().filter_map(|d| match &**d {
            Decoded::Picture(p) => Some(&p.metadata),
            Decoded::Distant(d) => Some(&d.header.metadata),
            Decoded::Volume(_) | Decoded::Table(_) => None,
        })
    };
    let first = metadata().next();
    let first_volume = all_inputs().find_map(|d| if let Decoded::Volume(v) = &**d { Some(&v.header) } else { None });
    let mut outputs = Vec::new();
    let named = graph.outputs().map(|(n, v)| (n.to_owned(), v));
    let asked: Vec<_> = named.filter_map(|(n, v)| Some((job.outputs.get(&n)?.clone(), n, v))).collect();
    let mut all: Vec<(String, String, _)> = asked;
    for (node, file) in &job.dumps {
        let value = graph.find(node).ok_or_else(|| {
            let names: Vec<&str> = graph.iter().map(|(_, i)| i.name.as_str()).collect();
            let hint = pipe_graph::diagnostic::nearest(node, names).map(|n| format!("; did you mean `{n}`?")).unwrap_or_default();
            Failure::Graph(format!("--dump {node}: there is no such node or port{hint}"))
        })?;
        let name = format!("dump:{node}");
        rim.dumps.insert(name.clone(), value);
        all.push((file.clone(), name, value));
    }
    for (file, name, value) in all {
        let ty = graph.ty(value);
        let to = match ty {
            EdgeType::Image(t) => {
                let target = fits(Target::parse(&file), &name, &ty)?;
                let alpha = metadata().any(|m| m.had_alpha) || sets_alpha(graph);
                let channels = match (t.channels, alpha) {
                    (1, _) => Channels::Y,
                    (4, true) => Channels::Rgba,
                    _ => Channels::Rgb,
                };
                let options = WriteOptions { channels: Some(channels), ..job.write.clone() };
                let form = pipe_io::output_form(&target, &options, first)?;
                rim.outputs.insert(name.clone(), forms::of_form(&form, t.size));
                Packed::Image { target, form, size: t.size }
            }
            EdgeType::Table(_) | EdgeType::Scalar(_) => Packed::Data(ReadbackFile { path: file, element: None, channels: Vec::new(), ty }),
            EdgeType::Volume(ty) => {
                let path = PathBuf::from(&file);
                let voxel = fits(pipe_io::volume::voxel_written(&path, job.write.pixel_type), &name, &EdgeType::Volume(ty))?;
                Packed::Volume { path, ty, spacing: spacing(ty.size, first_volume), voxel }
            }
            EdgeType::Mesh(_) => {
                let path = PathBuf::from(&file);
                fits(pipe_io::mesh::MeshFormat::of(&path), &name, &ty)?;
                Packed::Mesh(path)
            }
        };
        outputs.push(Output { name, to, metadata: first.cloned() });
    }
    Ok((rim, outputs))
}

/// What a file name means for an output of this type; tells what would fit when it means nothing.
fn fits<T>(meaning: pipe_io::Result<T>, output: &str, ty: &EdgeType) -> Result<T, Failure> {
    meaning.map_err(|e| match e {
        pipe_io::Error::UnknownExtension { file, known } => {
            Failure::Graph(format!("output `{output}` is {ty}, which `{file}` cannot hold\n  next: end the file's name in one of {known}"))
        }
        other => other.into(),
    })
}

/// The distance between voxels of an output that extends as far as the input: resampling does not change the extent.
fn spacing(size: [u32; 3], input: Option<&VolumeHeader>) -> [f32; 3] {
    input.map_or([1.0; 3], |input| std::array::from_fn(|i| input.spacing[i] * input.size[i] as f32 / size[i] as f32))
}

/// Whether some node of the graph may make alpha other than 1 where the inputs had none.
fn sets_alpha(graph: &Graph) -> bool {
    let sets = |instance: &Instance| match &instance.work {
        // What lies outside is transparent, and may come in.
        Work::Node(node) => node.makes_alpha() || instance.options.border == Border::Black,
        Work::Iterate(iteration) => sets_alpha(&iteration.body),
        _ => false,
    };
    graph.iter().any(|(_, i)| sets(i))
}

/// Readback nodes and options of a graph, by the name that they are fetched by.
pub fn readbacks(graph: &Graph) -> Vec<(String, ReadbackFile)> {
    let mut found = Vec::new();
    for (_, instance) in graph.iter() {
        let types: Vec<EdgeType> = instance.inputs.iter().map(|v| graph.ty(*v)).collect();
        if let Work::Node(node) = &instance.work
            && let Some(file) = node.readback(&types)
        {
            found.push((instance.name.clone(), file));
        }
        if let (Some(path), Some(output)) = (&instance.options.readback, instance.outputs.first()) {
            let file = ReadbackFile { path: path.clone(), element: None, channels: Vec::new(), ty: output.ty };
            found.push((readback_name(instance), file));
        }
    }
    found
}

/// The size of the first input or output that has one.
pub fn first_size(graph: &Graph) -> Vec<u32> {
    let outputs = graph.outputs().map(|(_, v)| graph.ty(v));
    let mut all = graph.inputs().map(|(_, t)| t).chain(outputs);
    let size = |t: EdgeType| match t {
        EdgeType::Image(t) => Some(t.size.to_vec()),
        EdgeType::Volume(t) => Some(t.size.to_vec()),
        _ => None,
    };
    all.find_map(size).unwrap_or_default()
}

/// Lowers and plans.
pub fn make_plan(graph: &Graph, rim: &Rim, limits: &Limits, job: &Job) -> Result<Plan, Failure> {
    // An output that no file is bound to is not computed.
    let wanted = |fetch: &str| {
        // Of a mesh three parts are fetched, `NAME.vertices` and so on.
        let name = fetch.split_once('.').map_or(fetch, |(name, _)| name);
        job.outputs.contains_key(name) || !graph.outputs().any(|(n, _)| n == name)
    };
    let options = Options { fuse: job.fuse, budget: job.budget, keep: job.keep, ..Options::default() };
    Ok(pipe_plan::plan_graph(graph, rim, limits, &options, &wanted)?)
}
