//! Every preset that makes an image of one image or one volume, from file to file, against its twin in double precision and against a picture that
//! the twin made earlier.
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

/// Parameters of the presets that would take a twin too long at their defaults.
const SMALLER: [(&str, u32); 7] =
    [("size", 96), ("photons", 4000), ("voxels", 12), ("paths", 2), ("width", 48), ("height", 27), ("steps", 60)];

/// What a preset is given: a file, and the same in double precision.
struct Subject {
    file: String,
    value: Tensor,
    ty: EdgeType,
}

impl Subject {
    /// `None` for presets that take something else.
    fn of(kind: EdgeKind, folder: &std::path::Path) -> Option<Self> {
        match kind {
            EdgeKind::Image => {
                let file = path(INPUT);
                let picture = raster(&read(&file));
                let ty = EdgeType::image(picture.size, 4);
                Some(Self { file, value: Tensor::Image(picture), ty })
            }
            EdgeKind::Volume => {
                let (file, block) = (folder.join("lumps.nrrd"), lumps());
                let floats: Vec<f32> = block.voxels.iter().map(|v| v[0] as f32).collect();
                let volume = Volume::of_floats(block.size, 1, [1.0; 3], &floats, Voxel::F32);
                pipe_io::volume::write(&file, &volume).unwrap_or_else(|e| panic!("{e}"));
                let ty = EdgeType::volume(block.size, 1);
                Some(Self { file: file.display().to_string(), value: Tensor::Volume(block), ty })
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
    for name in presets::names() {
        let mut project = Project::open(name).unwrap_or_else(|e| panic!("{e}"));
        let document = project.document.clone().expect("presets parse");
        if document.inputs.len() > 1 || document.outputs.is_empty() {
            continue;
        }
        let input = document.inputs.first().map(|i| i.name.value.clone());
        let subject = document.inputs.first().and_then(|i| Subject::of(i.kind, folder.path()));
        if input.is_some() != subject.is_some() {
            continue;
        }
        // Pictures come small; of volumes the picture is made small, of sources everything.
        let made_smaller = match subject.as_ref().map(|s| s.ty) {
            None => SMALLER.as_slice(),
            Some(EdgeType::Volume(_)) => &SMALLER[..1],
            Some(_) => &[],
        };
        let smaller = made_smaller.iter().filter(|(name, _)| document.params.iter().any(|p| p.name.value == *name));
        let settings: Vec<_> = smaller.map(|(name, value)| ((*name).to_owned(), value.to_string())).collect();
        let request = Request {
            inputs: input.iter().zip(&subject).map(|(name, s)| (name.clone(), s.ty)).collect(),
            settings: settings.clone(),
            frame: 1.0,
            ..Request::default()
        };
        let graph = project.resolve(&request, &World::default()).unwrap_or_else(|| panic!("{}", project.render(false)));
        let (_, value) = graph.outputs().next().expect("it has an output");
        if graph.ty(value).kind() != EdgeKind::Image {
            continue;
        }
        seen += 1;
        // A user's shader has no twin; such a preset has its golden alone.
        let twin = graph.iter().all(|(_, i)| i.kind != "Wgsl").then(|| {
            let values = evaluate(&graph, &|_| subject.as_ref().expect("it is asked for its input").value.clone());
            match values.get(&value) {
                Some(Tensor::Image(raster)) => raster.clone(),
                _ => panic!("{name} makes no image"),
            }
        });

        let out = folder.path().join(format!("{name}.png")).display().to_string();
        let mut job = Job::new(name);
        job.settings = settings;
        if let (Some(input), Some(subject)) = (&input, &subject) {
            job.bind_input(input, &subject.file);
        }
        job.bind_output(&document.outputs[0].0.value, &out).expect("a png");
        session.run(&job).unwrap_or_else(|e| panic!("{name}: {e}"));
        let got = read(&out);
        let channels = got.channels.count();
        let expected = match twin {
            Some(twin) => twin.pixels.iter().flat_map(|p| stored(*p, channels)).collect(),
            None => bytes(&got),
        };
        let golden = path(&format!("golden/{name}.png"));
        if bless {
            let bytes = expected.iter().map(|v| *v as u8).collect();
            let target = pipe_io::Target::parse(&golden).expect("a png");
            let options =
                pipe_io::WriteOptions { channels: Some(got.channels), compression: Some(pipe_io::Compression::Best), ..Default::default() };
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
    assert!(seen >= 30, "only {seen} presets were tested");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
