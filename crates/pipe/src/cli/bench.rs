//! `bench`: GPU time, bytes and share of the measured copy bandwidth of every pass.

use std::fmt::Write as _;
use std::sync::Arc;

use indexmap::IndexMap;
use pipe::Failure;
use pipe::project::{Project, World};
use pipe::run::{Decoded, Inputs, Job, Report, Session, input_kinds, request};
use pipe_graph::types::EdgeKind;
use pipe_io::volume::{Volume, Voxel};
use pipe_io::{Alpha, Channels, Colour, Layout, Metadata, Picture, Primaries, Sample, Transfer};
use pipe_plan::plan::{Run, Step};
use serde_json::{Value, json};

use super::args::{self, BenchArgs};
use super::{cache_folder, colour, device_choice, print, print_json};

/// Measures a graph at one or more sizes.
pub(super) fn bench(a: &BenchArgs) -> Result<(), Failure> {
    let mut session = Session::open(&device_choice(a.device.device.as_deref()), cache_folder().as_deref())?;
    let sizes = if a.size.is_empty() { vec![[4096, 4096]] } else { a.size.iter().map(|s| args::size(s)).collect::<Result<_, _>>()? };
    let mut rows = Vec::new();
    for size in sizes {
        rows.push(one(&mut session, a, size)?);
    }
    if a.json {
        return print_json(&if rows.len() == 1 { rows.remove(0) } else { Value::Array(rows) });
    }
    for row in rows {
        print(&text(&row))?;
    }
    Ok(())
}

fn one(session: &mut Session, a: &BenchArgs, size: [u32; 2]) -> Result<Value, Failure> {
    let mut project = Project::open(&a.graph)?;
    let kinds = input_kinds(&mut project);
    let Some(document) = project.document.clone() else { return Err(project.failure(colour())) };
    let mut job = Job::new(&a.graph);
    job.settings = args::settings(&a.set)?;
    job.fuse = !a.device.no_fuse;
    job.budget = a.device.vram.as_deref().map(args::bytes).transpose()?;
    job.profile = true;
    let mut inputs = Inputs::new();
    for input in &document.inputs {
        let made = match kinds.get(&input.name.value) {
            Some(EdgeKind::Image) => Decoded::Picture(test_picture(size, a.float)),
            Some(EdgeKind::Volume) => Decoded::Volume(test_volume(size)),
            _ => return Err(Failure::Graph(format!("bench makes images and volumes only; input `{}` is neither", input.name.value))),
        };
        inputs.insert(input.name.value.clone(), Arc::new(made));
    }
    let Some(graph) = project.resolve(&request(&job, &inputs), &World::default()) else { return Err(project.failure(colour())) };
    for (name, value) in graph.outputs() {
        // Bound, so that it is computed and packed; never written.
        let file = match graph.ty(value).kind() {
            EdgeKind::Volume => "bench.nrrd",
            EdgeKind::Mesh => "bench.ply",
            EdgeKind::Image if a.float => "bench.exr",
            EdgeKind::Image | EdgeKind::Table | EdgeKind::Scalar => "bench.png",
        };
        job.bind_output(name, file)?;
    }
    let copy_gb_s = session.copy_bandwidth(size)?;
    let mut reports: Vec<Report> = Vec::new();
    for run in 0..=a.runs.max(1) {
        let report = session.execute(&job, &inputs, None, None)?.report;
        // The first run compiles and allocates.
        if run > 0 {
            reports.push(report);
        }
    }
    let median = |f: &dyn Fn(&Report) -> f64| {
        let mut all: Vec<f64> = reports.iter().map(f).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let plan = reports[0].plan.clone().ok_or_else(|| Failure::World("there was no plan".into()))?;
    let mut passes: IndexMap<String, (Vec<String>, u64)> = IndexMap::new();
    collect(&plan.steps, 1, &mut passes);
    let mut nodes = Vec::new();
    let mut gpu_ms = 0.0;
    for (name, (of, bytes)) in &passes {
        let ms = median(&|r| r.passes.get(name).copied().unwrap_or(0.0));
        gpu_ms += ms;
        let share = if ms > 0.0 { *bytes as f64 / (ms * 1e6) / copy_gb_s } else { 0.0 };
        nodes.push(json!({"name": name, "nodes": of, "gpu_ms": ms, "bytes": bytes, "share_of_copy": share}));
    }
    Ok(json!({
        "device": session.device_name(),
        "copy_gb_s": copy_gb_s,
        "size": size,
        "nodes": nodes,
        "gpu_ms": gpu_ms,
        "wall_ms": {
            "decode": median(&|r| r.wall.decode),
            "upload": median(&|r| r.wall.upload),
            "compute": median(&|r| r.wall.compute),
            "readback": median(&|r| r.wall.readback),
            "encode": median(&|r| r.wall.encode),
            "total": median(&|r| r.wall.total),
        },
    }))
}

/// Bytes of each pass over a whole run; a loop that ends by a value counts up to its first check.
fn collect(steps: &[Step], times: u64, passes: &mut IndexMap<String, (Vec<String>, u64)>) {
    for step in steps {
        match step {
            Step::Run(Run { name, nodes, bytes, .. }) => {
                passes.entry(name.clone()).or_insert_with(|| (nodes.clone(), 0)).1 += bytes * times;
            }
            Step::Repeat(r) => {
                collect(&r.first, times * u64::from(r.count.least()), passes);
            }
            Step::Tiles(t) => collect(&t.body, times * t.tiles.len() as u64, passes),
        }
    }
}

/// A soft lumpy ball of 8-bit voxels in a cube of at most 512 a side.
fn test_volume(size: [u32; 2]) -> Volume {
    let n = size[0].min(size[1]).min(512);
    let at = |i: u32| (i as f32 + 0.5) / n as f32 - 0.5;
    let mut floats = Vec::with_capacity((n * n * n) as usize);
    for (z, y) in (0..n).flat_map(|z| (0..n).map(move |y| (z, y))) {
        for x in 0..n {
            let [x, y, z] = [x, y, z].map(at);
            let lumps = 0.05 * ((30.0 * x).sin() * (30.0 * y).sin() * (30.0 * z).sin());
            floats.push(0.5 + 4.0 * (0.35 + lumps - (x * x + y * y + z * z).sqrt()));
        }
    }
    Volume::of_floats([n; 3], 1, [1.0; 3], &floats, Voxel::U8)
}

/// An RGB picture of waves and noise, neither constant nor pure noise, in halfs or in floats.
fn test_picture(size: [u32; 2], float: bool) -> Picture {
    let [w, h] = size.map(|n| n as usize);
    let mut bytes = Vec::with_capacity(w * h * 6);
    let mut state = 1_u32;
    for c in 0..3 {
        for y in 0..h {
            for x in 0..w {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let wave = ((x * (c + 2)) as f32 * 0.01).sin() * (y as f32 * 0.013).cos();
                let v = (0.6 + 0.5 * wave + (state >> 20) as f32 * 5e-5).max(0.0);
                if float {
                    bytes.extend(v.to_le_bytes());
                } else {
                    bytes.extend(half::f16::from_f32(v).to_le_bytes());
                }
            }
        }
    }
    Picture {
        width: size[0],
        height: size[1],
        sample: if float { Sample::F32 } else { Sample::F16 },
        layout: Layout::Planar,
        channels: Channels::Rgb,
        alpha: Alpha::None,
        colour: Colour { primaries: Primaries::REC709, transfer: Transfer::Linear },
        bytes,
        metadata: Metadata::default(),
    }
}

fn text(row: &Value) -> String {
    let number = |v: &Value| v.as_f64().unwrap_or(0.0);
    let mut out = format!(
        "{} at {}x{}, copy {:.0} GB/s\n{:>10} {:>12} {:>8}  pass\n",
        row["device"].as_str().unwrap_or_default(),
        row["size"][0],
        row["size"][1],
        number(&row["copy_gb_s"]),
        "gpu ms",
        "MB",
        "of copy"
    );
    for node in row["nodes"].as_array().into_iter().flatten() {
        let _ = writeln!(
            out,
            "{:>10.3} {:>12.1} {:>8.2}  {}",
            number(&node["gpu_ms"]),
            number(&node["bytes"]) / 1e6,
            number(&node["share_of_copy"]),
            node["name"].as_str().unwrap_or_default()
        );
    }
    let w = &row["wall_ms"];
    let _ = writeln!(
        out,
        "{:>10.3} all   wall ms: upload {:.1}, compute {:.1}, readback {:.1}, total {:.1}",
        number(&row["gpu_ms"]),
        number(&w["upload"]),
        number(&w["compute"]),
        number(&w["readback"]),
        number(&w["total"])
    );
    out
}
