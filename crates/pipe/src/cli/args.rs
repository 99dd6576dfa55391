//! What was typed. The same definitions give the help, the man page and the shell completions.

use std::path::PathBuf;

use clap::{Args, CommandFactory, Parser, Subcommand};
use pipe::Failure;
use pipe::run::Job;
use pipe_io::{Colorspace, Compression, Sample};

/// Runs node-graph image pipelines on the GPU.
#[derive(Debug, Parser)]
#[command(name = "pipe", version, about, arg_required_else_help = true, max_term_width = 100)]
pub(crate) struct Cli {
    /// Say nothing but errors.
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    /// Say more.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    /// Run a graph on files.
    Run(RunArgs),
    /// Tell every mistake in a graph; needs no GPU.
    Check(CheckArgs),
    /// Show passes, slots, memory and bytes moved; needs no GPU.
    Plan(PlanArgs),
    /// Show a graph's inputs, outputs and parameters.
    Info(CheckArgs),
    /// Show the node library, or the reference of one node.
    Nodes(NodesArgs),
    /// Show the graphs that come with the program.
    Presets(PresetsArgs),
    /// Show adapters, their limits and features.
    Devices(DevicesArgs),
    /// Compare two images; exit code 1 when they differ more than allowed.
    Compare(CompareArgs),
    /// Run the golden tests of a folder.
    Test(TestArgs),
    /// Measure each node: GPU time, bytes, share of the measured copy bandwidth.
    Bench(BenchArgs),
    /// Run again whenever the graph, its shaders or its inputs are saved.
    Watch(RunArgs),
    /// Test the adapter and say what to install.
    Doctor(DoctorArgs),
    /// Print completions for a shell.
    Completions {
        /// bash, zsh, fish, elvish or powershell.
        shell: clap_complete::Shell,
    },
    /// Print the manual page.
    Man,
}

/// Where files, parameters and the device come from.
#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// The graph: a path, or the bare name of a preset.
    pub(crate) graph: String,
    /// One input and one output file, where the graph has one of each; `-` is a stream, `file.exr#layer` a layer.
    pub(crate) files: Vec<String>,
    /// A file for a graph input.
    #[arg(short, long = "input", value_name = "NAME=FILE")]
    pub(crate) input: Vec<String>,
    /// A file for a graph output.
    #[arg(short, long = "output", value_name = "NAME=FILE")]
    pub(crate) output: Vec<String>,
    /// A parameter of the graph, or a field of a node.
    #[arg(long, value_name = "[NODE.]NAME=VALUE")]
    pub(crate) set: Vec<String>,
    /// Frames of a sequence: `1-100`, `1-100x5`; files are named `in.####.exr` or `in.%04d.exr`.
    #[arg(long, value_name = "A-B[xSTEP]")]
    pub(crate) frames: Option<String>,
    /// Frames a second: what `time` counts by, and the speed of .apng and .gif outputs.
    #[arg(long, value_name = "N", default_value_t = 24.0)]
    pub(crate) fps: f64,
    /// Skip frames whose outputs are there already.
    #[arg(long)]
    pub(crate) resume: bool,
    /// Report a missing or broken frame and go on.
    #[arg(long)]
    pub(crate) skip_bad_frames: bool,
    #[command(flatten)]
    pub(crate) device: DeviceArgs,
    /// Seed of everything random.
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Write statistics, readbacks and timings as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) stats: Option<PathBuf>,
    /// Write a trace for chrome://tracing or Perfetto.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) trace: Option<PathBuf>,
    /// Write the value of a node, or of one of its ports.
    #[arg(long, value_name = "NODE=FILE")]
    pub(crate) dump: Vec<String>,
    /// Let an output overwrite an input.
    #[arg(long)]
    pub(crate) force: bool,
    /// Most seconds of GPU work.
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    pub(crate) timeout: u64,
    /// Colour space of the inputs: linear-rec709, srgb, rec2020-linear, acescg, raw.
    #[arg(long, value_name = "SPACE")]
    pub(crate) in_colorspace: Option<String>,
    /// Colour space of the outputs.
    #[arg(long, value_name = "SPACE")]
    pub(crate) out_colorspace: Option<String>,
    /// Pixel type of the outputs: half, float, u8, u16.
    #[arg(long, value_name = "TYPE")]
    pub(crate) pixel_type: Option<String>,
    /// Compression of the outputs, such as zip, piz, dwaa for EXR, fastest, balanced, best for PNG.
    #[arg(long, value_name = "NAME")]
    pub(crate) compression: Option<String>,
    /// Quality of JPEG outputs, 1 to 100.
    #[arg(long, default_value_t = 95)]
    pub(crate) quality: u8,
    /// Most pixels of an input image.
    #[arg(long, value_name = "N")]
    pub(crate) max_pixels: Option<u64>,
}

/// The device and what plans for it may do.
#[derive(Debug, Args)]
pub(crate) struct DeviceArgs {
    /// A number of `pipe devices`, part of a name, or `cpu`; also PIPE_DEVICE.
    #[arg(long, value_name = "N|NAME|cpu")]
    pub(crate) device: Option<String>,
    /// Memory that a plan may take, such as 512MiB or 4GiB; what does not fit is made in tiles.
    #[arg(long, value_name = "SIZE")]
    pub(crate) vram: Option<String>,
    /// Run every pass on its own.
    #[arg(long)]
    pub(crate) no_fuse: bool,
}

#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// The graph.
    pub(crate) graph: String,
    /// Answer as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// A parameter of the graph, or a field of a node.
    #[arg(long, value_name = "[NODE.]NAME=VALUE")]
    pub(crate) set: Vec<String>,
}

#[derive(Debug, Args)]
pub(crate) struct PlanArgs {
    /// The graph.
    pub(crate) graph: String,
    /// Size of the inputs, 1920x1080 unless given.
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<String>,
    /// Show what there is after a phase: lower, prune, fuse, schedule, allocate.
    #[arg(long, value_name = "PHASE")]
    pub(crate) after: Option<String>,
    /// As JSON.
    #[arg(long, conflicts_with_all = ["dot", "svg"])]
    pub(crate) json: bool,
    /// As a Graphviz graph.
    #[arg(long, conflicts_with = "svg")]
    pub(crate) dot: bool,
    /// As a picture of slots over time.
    #[arg(long)]
    pub(crate) svg: bool,
    /// Print the WGSL of every kernel.
    #[arg(long)]
    pub(crate) wgsl: bool,
    /// A parameter of the graph, or a field of a node.
    #[arg(long, value_name = "[NODE.]NAME=VALUE")]
    pub(crate) set: Vec<String>,
    /// Plan for a CPU device.
    #[arg(long)]
    pub(crate) cpu: bool,
    /// Memory that the plan may take; what does not fit is made in tiles.
    #[arg(long, value_name = "SIZE")]
    pub(crate) vram: Option<String>,
    /// Leave every pass on its own.
    #[arg(long)]
    pub(crate) no_fuse: bool,
}

#[derive(Debug, Args)]
pub(crate) struct NodesArgs {
    /// Which one.
    pub(crate) name: Option<String>,
    /// Answer as JSON (for a node: its JSON schema).
    #[arg(long)]
    pub(crate) json: bool,
    /// As Markdown: the reference page.
    #[arg(long)]
    pub(crate) markdown: bool,
}

#[derive(Debug, Args)]
pub(crate) struct PresetsArgs {
    /// Which one.
    pub(crate) name: Option<String>,
    /// Answer as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// Run every preset and write a page with their pictures into a folder.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) gallery: Option<PathBuf>,
    /// The picture for presets that take one.
    #[arg(long, value_name = "FILE", requires = "gallery")]
    pub(crate) image: Option<String>,
    /// The volume for presets that take one.
    #[arg(long, value_name = "FILE", requires = "gallery")]
    pub(crate) volume: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct DevicesArgs {
    /// Show what texture formats allow.
    #[arg(long)]
    pub(crate) formats: bool,
    /// Answer as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    /// The first image.
    pub(crate) a: String,
    /// The second image.
    pub(crate) b: String,
    /// Largest difference that does not count.
    #[arg(long, value_name = "LIMIT", default_value_t = 0.0)]
    pub(crate) fail: f64,
    /// Share of differing pixels that is accepted, in percent.
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0)]
    pub(crate) fail_percent: f64,
    /// Write the difference as a picture.
    #[arg(long, value_name = "FILE")]
    pub(crate) diff: Option<String>,
    /// Answer as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct TestArgs {
    /// The folder with the tests.
    pub(crate) folder: PathBuf,
    /// Write the results as the expected ones.
    #[arg(long)]
    pub(crate) bless: bool,
    /// Answer as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) device: DeviceArgs,
}

#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    /// The graph.
    pub(crate) graph: String,
    /// Sizes of the inputs, 4096x4096 unless given.
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Vec<String>,
    /// Pictures are 32-bit floats on their way in and out, not halfs and 8-bit sRGB: what nodes cost without conversion.
    #[arg(long)]
    pub(crate) float: bool,
    /// Runs that are measured; the median counts.
    #[arg(long, default_value_t = 7)]
    pub(crate) runs: u32,
    /// A parameter of the graph, or a field of a node.
    #[arg(long, value_name = "[NODE.]NAME=VALUE")]
    pub(crate) set: Vec<String>,
    /// Answer as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) device: DeviceArgs,
}

#[derive(Debug, Args)]
pub(crate) struct DoctorArgs {
    /// Answer as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// The device to test.
    #[arg(long, value_name = "N|NAME|cpu")]
    pub(crate) device: Option<String>,
}

/// `NAME=VALUE`
pub(crate) fn pair(text: &str, flag: &str) -> Result<(String, String), Failure> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        _ => Err(Failure::Graph(format!("{flag} {text}: expected NAME=VALUE"))),
    }
}

/// All `--set` of a verb.
pub(crate) fn settings(set: &[String]) -> Result<Vec<(String, String)>, Failure> {
    set.iter().map(|s| pair(s, "--set")).collect()
}

/// `4GiB`, `512MiB`, `1000000`
pub(crate) fn bytes(text: &str) -> Result<u64, Failure> {
    let digits = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let scale: f64 = match unit.trim().to_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kib" => 1024.0,
        "kb" => 1e3,
        "m" | "mib" => 1024.0 * 1024.0,
        "mb" => 1e6,
        "g" | "gib" => 1024.0 * 1024.0 * 1024.0,
        "gb" => 1e9,
        _ => return Err(Failure::Graph(format!("{text} is no size; expected such as 512MiB or 4GiB"))),
    };
    match number.parse::<f64>() {
        Ok(n) if n > 0.0 => Ok((n * scale) as u64),
        _ => Err(Failure::Graph(format!("{text} is no size; expected such as 512MiB or 4GiB"))),
    }
}

/// `1920x1080`
pub(crate) fn size(text: &str) -> Result<[u32; 2], Failure> {
    let parsed = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.trim().parse().ok()?, h.trim().parse().ok()?]));
    match parsed {
        Some([w, h]) if w > 0 && h > 0 => Ok([w, h]),
        _ => Err(Failure::Graph(format!("{text} is no size; expected WIDTHxHEIGHT, such as 1920x1080"))),
    }
}

/// The options of a run that need no look at the graph.
pub(crate) fn job(a: &RunArgs) -> Result<Job, Failure> {
    let mut job = Job::new(&a.graph);
    job.settings = settings(&a.set)?;
    for text in &a.dump {
        let (node, file) = pair(text, "--dump")?;
        if let Some(before) = job.dumps.insert(node.clone(), file) {
            return Err(Failure::Graph(format!("--dump {node} is given twice, first as {before}\n  next: keep one of them")));
        }
    }
    job.fuse = !a.device.no_fuse;
    job.budget = a.device.vram.as_deref().map(bytes).transpose()?;
    job.seed = a.seed;
    if a.timeout < 1 {
        return Err(Failure::Graph(format!("--timeout {}: expected 1 second or more", a.timeout)));
    }
    job.timeout = Some(std::time::Duration::from_secs(a.timeout));
    if !(a.fps > 0.0 && a.fps <= 1000.0) {
        return Err(Failure::Graph(format!("--fps {}: expected more than 0, at most 1000", a.fps)));
    }
    job.rate = a.fps;
    job.force = a.force;
    job.profile = a.trace.is_some();
    if let Some(most) = a.max_pixels {
        job.read.limits.max_pixels = most;
    }
    let space = |text: &Option<String>| -> Result<Option<Colorspace>, Failure> { Ok(text.as_deref().map(str::parse).transpose()?) };
    job.read.colorspace = space(&a.in_colorspace)?;
    job.write.colorspace = space(&a.out_colorspace)?;
    job.write.quality = a.quality;
    job.write.pixel_type = a.pixel_type.as_deref().map(str::parse::<Sample>).transpose()?;
    job.write.compression = a.compression.as_deref().map(str::parse::<Compression>).transpose()?;
    Ok(job)
}

pub(crate) fn completions(shell: clap_complete::Shell) -> Result<(), Failure> {
    let mut out = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "pipe", &mut out);
    super::print(&String::from_utf8_lossy(&out))
}

pub(crate) fn man() -> Result<(), Failure> {
    let mut out = Vec::new();
    let render = |out: &mut Vec<u8>| -> std::io::Result<()> {
        clap_mangen::Man::new(Cli::command()).render(out)?;
        for verb in Cli::command().get_subcommands() {
            clap_mangen::Man::new(verb.clone().name(format!("pipe-{}", verb.get_name()))).render(out)?;
        }
        Ok(())
    };
    render(&mut out).map_err(|e| Failure::World(e.to_string()))?;
    super::print(&String::from_utf8_lossy(&out))
}
