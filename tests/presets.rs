//! Every preset that takes one image, one volume or nothing, from file to file, against its twin in double precision and
//! against a picture that the twin made earlier.
//!
//! `PIPE_BLESS=1 cargo test -p pipe-tests --test presets` writes the pictures anew, from the twin, never from the GPU.

use std::path::PathBuf;

use pipe::presets;
use pipe::project::{Project, World};
use pipe::run::{Job, Session};
use pipe_graph::reference::{Block, Raster, Tensor, evaluate};
use pipe_graph::resolve::Request;
use pipe_graph::types::{EdgeKind, EdgeType};
use pipe_io::volume::{Volume, Voxel};
use pipe_io::{Picture, ReadOptions, Source};

const INPUT: &str = "data/workshop-small.exr";

/// Code values by which the 8-bit picture may be off: rounding, and powers that devices compute to six digits.
const ALLOWED: i32 = 1;

fn path(relative: &str) -> String {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(relative).display().to_string()
}

fn read(file: &str) -> Picture {
    pipe_io::read(&Source::parse(file), &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn raster(p: &Picture) -> Raster {
    let n = p.channels.count();
    Raster::from_fn([p.width, p.height], if n == 1 { 1 } else { 4 }, |x, y| {
        let at = |c: usize| f64::from(p.sample_at(x as u32, y as u32, c.min(n - 1)).expect("inside"));
        [at(0), at(1), at(2), 1.0]
    })
}

/// Two soft lumps that touch, in a box that is no cube.
fn lumps() -> Block {
    Block::from_fn([36, 44, 32], 1, |x, y, z| {
        let p = [x as f64 / 35.0, y as f64 / 43.0, z as f64 / 31.0];
        let lump = |centre: [f64; 3], width: f64| {
            let squared: f64 = p.iter().zip(centre).map(|(a, b)| (a - b) * (a - b)).sum();
            (-squared / (2.0 * width * width)).exp()
        };
        let v = 0.7 * lump([0.5, 0.35, 0.45], 0.14) + 0.6 * lump([0.45, 0.68, 0.55], 0.1);
        let v = f64::from(v as f32);
        [v, v, v, 1.0]
    })
}

/// What a preset is given: a file, and the same in double precision.
struct Subject {
    input: Option<(String, Tensor, EdgeType)>,
    settings: Vec<(String, String)>,
}

/// Little work for presets that take nothing.
const SMALL: [(&str, &str); 4] = [
    ("cloud-chamber", "size=56 photons=40000 voxels=14"),
    ("fog-light", "width=64 height=36 photons=20000 voxels=14 paths=4"),
    ("reaction-diffusion", "size=96 steps=400"),
    ("wave-pool", "size=96 steps=20"),
];

impl Subject {
    /// For a preset without inputs.
    fn nothing(preset: &str) -> Self {
        let settings = SMALL.iter().find(|(name, _)| *name == preset).map_or("", |(_, settings)| settings);
        let settings = settings.split(' ').filter_map(|s| s.split_once('=')).map(|(name, value)| (name.to_owned(), value.to_owned()));
        Self { input: None, settings: settings.collect() }
    }

    /// `None` for presets that take something else.
    fn of(kind: EdgeKind, folder: &std::path::Path) -> Option<Self> {
        match kind {
            EdgeKind::Image => {
                let file = path(INPUT);
                let picture = raster(&read(&file));
                let ty = EdgeType::image(picture.size, 4);
                Some(Self { input: Some((file, Tensor::Image(picture), ty)), settings: Vec::new() })
            }
            EdgeKind::Volume => {
                let (file, block) = (folder.join("lumps.nrrd"), lumps());
                let floats: Vec<f32> = block.voxels.iter().map(|v| v[0] as f32).collect();
                let volume = Volume::of_floats(block.size, 1, [1.0; 3], &floats, Voxel::F32);
                pipe_io::volume::write(&file, &volume).unwrap_or_else(|e| panic!("{e}"));
                let ty = EdgeType::volume(block.size, 1);
                let settings = vec![("size".to_owned(), "96".to_owned())];
                Some(Self { input: Some((file.display().to_string(), Tensor::Volume(block), ty)), settings })
            }
            _ => None,
        }
    }
}

/// The samples of a pixel as an 8-bit file has them: colour not multiplied by alpha.
fn stored(p: [f64; 4], channels: usize) -> Vec<i32> {
    let alpha = if channels == 4 && p[3] > 0.0 { p[3].clamp(0.0, 1.0) } else { 1.0 };
    let sample = |c: usize| if c == 3 { (p[3].clamp(0.0, 1.0) * 255.0 + 0.5) as i32 } else { encode(p[c] / alpha) };
    (0..channels).map(sample).collect()
}

/// 8-bit sRGB, rounded to nearest.
fn encode(v: f64) -> i32 {
    let v = v.clamp(0.0, 1.0);
    let e = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (e * 255.0 + 0.5).floor() as i32
}

fn bytes(p: &Picture) -> Vec<i32> {
    p.bytes.iter().map(|b| i32::from(*b)).collect()
}

#[test]
fn presets_agree_with_their_twins_and_goldens() {
    let choice = pipe_gpu::Choice::parse(&std::env::var("PIPE_DEVICE").unwrap_or_default());
    let mut session = Session::open(&choice, None).unwrap_or_else(|e| panic!("{e}"));
    let folder = tempfile::tempdir().expect("a folder");
    let bless = std::env::var_os("PIPE_BLESS").is_some();
    let (mut seen, mut wrong) = (0, Vec::new());
    for preset in presets::names() {
        let mut project = Project::open(preset).unwrap_or_else(|e| panic!("{e}"));
        let document = project.document.clone().expect("presets parse");
        let subject = match document.inputs.as_slice() {
            [] => Some(Subject::nothing(preset)),
            [input] => Subject::of(input.kind, folder.path()),
            _ => None,
        };
        let Some(mut subject) = subject else { continue };
        subject.settings.retain(|(name, _)| document.params.iter().any(|p| p.name.value == *name));
        let given = |value: EdgeType| (document.inputs[0].name.value.clone(), value);
        let request = Request {
            inputs: subject.input.iter().map(|(_, _, ty)| given(*ty)).collect(),
            settings: subject.settings.clone(),
            frame: 1.0,
            ..Request::default()
        };
        let graph = project.resolve(&request, &World::default()).unwrap_or_else(|| panic!("{}", project.render(false)));
        let pictures: Vec<_> = graph.outputs().filter(|(_, value)| graph.ty(*value).kind() == EdgeKind::Image).collect();
        if pictures.is_empty() {
            continue;
        }
        let twins = evaluate(&graph, &|_| subject.input.as_ref().expect("it asks for its input").1.clone());
        for (output, value) in pictures {
            seen += 1;
            let Some(Tensor::Image(twin)) = twins.get(&value) else { panic!("{preset} makes no image") };
            // Presets with several pictures have a golden for each.
            let name = if graph.outputs().count() == 1 { preset.to_owned() } else { format!("{preset}-{output}") };
            let out = folder.path().join(format!("{name}.png")).display().to_string();
            let mut job = Job::new(preset);
            job.settings.clone_from(&subject.settings);
            if let Some((file, ..)) = &subject.input {
                job.bind_input(&document.inputs[0].name.value, file);
            }
            job.bind_output(output, &out).expect("a png");
            session.run(&job).unwrap_or_else(|e| panic!("{name}: {e}"));
            let got = read(&out);
            let channels = got.channels.count();
            let expected: Vec<i32> = twin.pixels.iter().flat_map(|p| stored(*p, channels)).collect();
            let golden = path(&format!("golden/{name}.png"));
            if bless {
                let bytes = expected.iter().map(|v| *v as u8).collect();
                let target = pipe_io::Target::parse(&golden).expect("a png");
                let compression = Some(pipe_io::Compression::Best);
                let options = pipe_io::WriteOptions { channels: Some(got.channels), compression, ..Default::default() };
                pipe_io::write(&target, &Picture { bytes, ..got.clone() }, &options).unwrap_or_else(|e| panic!("{e}"));
            }
            for (what, other) in [("its twin", &expected), ("its golden", &bytes(&read(&golden)))] {
                let off = bytes(&got).iter().zip(other).map(|(a, b)| (a - b).abs()).max().unwrap_or(i32::MAX);
                let count = bytes(&got).iter().zip(other).filter(|(a, b)| (*a - *b).abs() > ALLOWED).count();
                // A value on the edge of a level may fall to either side; a few in a thousand may.
                if bytes(&got).len() != other.len() || count * 500 > other.len() {
                    wrong.push(format!("{name} is off {what} by up to {off}, more than {ALLOWED} at {count} of {} samples", other.len()));
                }
            }
        }
    }
    assert!(seen >= 30, "only {seen} presets were tested");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
