//! Volumes and their viewers against geometry and optics: spheres of known depth, area and volume, transmittance of known
//! length, meshes whose every side is shared by two triangles.

#![allow(clippy::unwrap_used)] // a test may stop where it stands

use std::collections::HashMap;
use std::path::Path;

use pipe::run::{Job, Session};
use pipe_graph::pass::Limits;
use pipe_graph::reference::{Block, Tensor};
use pipe_graph::types::{EdgeType, Element};
use pipe_tests::bench::{Bench, Values, compile, reference};
use pipe_tests::source::{edge, edge_type};

type Vector = [f64; 3];

fn sub(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn graph_text(nodes: &str, outputs: &str) -> String {
    format!("Graph(version: 1, nodes: {{{nodes}}}, outputs: {{{outputs}}})")
}

/// The outputs of a graph without inputs.
fn run(nodes: &str, outputs: &str) -> Values {
    let graph = compile(&graph_text(nodes, outputs), &[]).unwrap_or_else(|e| panic!("{e}"));
    Bench::new().gpu(&graph, &|name| -> Tensor { panic!("there is no input {name}") }).unwrap_or_else(|e| panic!("{e}"))
}

/// Direction of the ray through a pixel for an eye on the z axis of the cube, looking along −z with a field of view of 45°.
fn direction(x: usize, y: usize, size: usize) -> Vector {
    let reach = (22.5_f64).to_radians().tan();
    let at = |i: usize| ((i as f64 + 0.5) * 2.0 / size as f64 - 1.0) * reach;
    let d = [at(x), -at(y), -1.0];
    let length = dot(d, d).sqrt();
    d.map(|v| v / length)
}

const EYE: Vector = [0.5, 0.5, 2.5];

#[test]
fn the_isosurface_of_a_sphere_is_where_and_as_geometry_says() {
    const SIZE: usize = 65;
    let values = run(
        r#""ball": VolumeShape(resolution: 96, size: 0.35, softness: 0.2),
           "seen": Isosurface(volume: "ball", steps: 128, camera: (size: (65, 65)))"#,
        r#""out": "seen", "depth": "seen.depth", "normal": "seen.normal""#,
    );
    let light = [0.3, -2.0, 0.0];
    let (mut hits, mut misses) = (0, 0);
    for (i, depth) in values["depth"].iter().enumerate() {
        let d = direction(i % SIZE, i / SIZE, SIZE);
        let to_eye = sub(EYE, [0.5; 3]);
        let b = dot(to_eye, d);
        let discriminant = b * b - dot(to_eye, to_eye) + 0.35 * 0.35;
        if discriminant < -0.002 {
            assert_eq!(*depth, 0.0, "pixel {i} misses");
            misses += 1;
        }
        // Grazing rays turn a small error of the surface into a large one of depth.
        if discriminant < 0.015 {
            continue;
        }
        hits += 1;
        let expected = -b - discriminant.sqrt();
        assert!((depth - expected).abs() < 6e-4, "depth of pixel {i}: {depth}, not {expected}");
        let p: Vector = std::array::from_fn(|k| EYE[k] + expected * d[k]);
        let n = sub(p, [0.5; 3]).map(|v| v / 0.35);
        let got = &values["normal"][4 * i..4 * i + 4];
        let off = (0..3).map(|k| (got[k] - n[k]).abs()).fold(0.0, f64::max);
        assert!(off < 4e-3 && got[3] == 1.0, "normal of pixel {i}: {got:?}, not {n:?}");
        let l = sub(light, p);
        let shade = 0.5 + 0.5 * dot(n, l) / dot(l, l).sqrt();
        assert!((values["out"][4 * i] - shade).abs() < 4e-3, "shade of pixel {i}: {}, not {shade}", values["out"][4 * i]);
    }
    assert!(hits > 500 && misses > 2000, "{hits} hits, {misses} misses");
}

#[test]
fn the_surface_is_refined() {
    let seen = |refine: bool| {
        run(
            &format!(
                r#""ball": VolumeShape(resolution: 64, size: 0.35, softness: 0.2),
                   "seen": Isosurface(volume: "ball", steps: 16, refine: {refine}, camera: (size: (1, 1)))"#
            ),
            r#""depth": "seen.depth""#,
        )["depth"][0]
    };
    assert!((seen(true) - 1.65).abs() < 5e-4, "{}", seen(true));
    assert!((seen(false) - 1.65).abs() > 1e-2, "without refinement it is a whole sample: {}", seen(false));
}

/// Transmittance of a homogeneous cube: (1 − α)^(length / reference step), whatever the number of steps.
#[test]
fn a_homogeneous_cube_lets_through_what_the_law_of_beer_says() {
    const SIZE: usize = 33;
    let alpha: f64 = 0.02;
    // The last one is a slab half as deep as it is wide.
    let views = [("FrontToBack", 256, 1.0), ("BackToFront", 256, 1.0), ("FrontToBack", 40, 1.0), ("BackToFront", 1000, 0.5)];
    for (order, steps, depth) in views {
        let values = run(
            &format!(
                r#""fog": VolumeShape(shape: Box, size: 2, resolution: 8),
                   "seen": VolumeRender(volume: "fog", order: {order}, steps: {steps}, alpha_center: {},
                                       camera: (size: (33, 33), extent: (1, 1, {depth})))"#,
                1.5 - alpha
            ),
            r#""out": "seen""#,
        );
        for i in 0..SIZE * SIZE {
            let d = direction(i % SIZE, i / SIZE, SIZE);
            let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
            for k in 0..3 {
                let half = if k == 2 { depth / 2.0 } else { 0.5 };
                let (a, b) = ((0.5 - half - EYE[k]) / d[k], (0.5 + half - EYE[k]) / d[k]);
                (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
            }
            let length = (leave - enter).max(0.0);
            let expected = 1.0 - (1.0 - alpha).powf(length * 256.0 / 3.0_f64.sqrt());
            let got = values["out"][4 * i + 3];
            assert!((got - expected).abs() < 1e-4, "{order}, {steps} steps, pixel {i}: {got}, not {expected}");
        }
    }
}

#[test]
fn both_orders_of_compositing_agree() {
    for body in [
        "VolumeNoise(resolution: 48, frequency: 5, seed: 2)",
        "VolumeShape(shape: Torus, resolution: 48, softness: 0.3)",
        "VolumeShape(shape: Sphere, resolution: 48, softness: 0.02, size: 0.45)",
    ] {
        for (exponent, center) in [(1.0, 0.5), (6.0, 0.55), (0.4, 1.6)] {
            let look = |order: &str| {
                format!(
                    r#"VolumeRender(volume: "body", order: {order}, alpha_exponent: {exponent}, alpha_center: {center},
                                   camera: (eye: (1.7, 1.4, 1.9), size: (48, 40)))"#
                )
            };
            let nodes = format!(r#""body": {body}, "front": {}, "back": {}"#, look("FrontToBack"), look("BackToFront"));
            let values = run(&nodes, r#""front": "front", "back": "back""#);
            let off = values["front"].iter().zip(&values["back"]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-4, "{body}, e = {exponent}, c = {center}: off by {off}");
            assert!(values["front"].iter().any(|v| *v > 0.1), "there is something to see");
        }
    }
}

/// Rays leap over bricks that a table makes transparent, and see what they would see without.
#[test]
fn tables_with_empty_ends_agree_with_the_twin() {
    let row = |alpha: f64| [0.9, 0.5 * alpha, 0.2, alpha];
    for alphas in [[0.0, 0.0, 0.0, 0.2, 0.4], [0.0, 0.0, 0.3, 0.0, 0.0], [0.1, 0.0, 0.0, 0.2, 0.0], [0.0; 5]] {
        let table: Vec<f64> = alphas.iter().flat_map(|a| row(*a)).map(|v| f64::from(v as f32)).collect();
        let text = r#"Graph(version: 1, inputs: {"volume": Volume, "table": Table}, nodes: {
            "seen": VolumeRender(volume: "volume", transfer: "table", steps: 90, camera: (eye: (1.6, 1.9, -1.2), size: (40, 37)))
        }, outputs: {"out": "seen"})"#;
        let types = [("volume", EdgeType::volume([21, 18, 15], 1)), ("table", EdgeType::table(20, Element::F32))];
        let graph = compile(text, &types).unwrap_or_else(|e| panic!("{e}"));
        let input = |name: &str| if name == "table" { Tensor::Table(table.clone()) } else { edge("volume", [1, 1]) };
        let (got, expected) = (Bench::new().gpu(&graph, &input).unwrap(), reference(&graph, &input));
        let off = got["out"].iter().zip(&expected["out"]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-4, "{alphas:?}: off by {off}");
    }
}

/// A mesh as its PLY file has it.
struct Mesh {
    vertices: Vec<Vector>,
    normals: Vec<Vector>,
    triangles: Vec<[usize; 3]>,
}

/// Runs a graph whose output `out` is a mesh, from file to file.
fn mesh(nodes: &str) -> Mesh {
    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("mesh.ron");
    std::fs::write(&graph, graph_text(nodes, r#""out": "mesh""#)).unwrap();
    let choice = pipe_gpu::Choice::parse(&std::env::var("PIPE_DEVICE").unwrap_or_default());
    let mut session = Session::open(&choice, None).unwrap_or_else(|e| panic!("{e}"));
    let ply = folder.path().join("mesh.ply");
    let mut job = Job::new(&graph.display().to_string());
    job.bind_output("out", &ply.display().to_string()).unwrap();
    session.run(&job).unwrap_or_else(|e| panic!("{e}"));
    read_ply(&ply)
}

fn read_ply(path: &Path) -> Mesh {
    let bytes = std::fs::read(path).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    let count =
        |what: &str| -> usize { header.split(&format!("element {what} ")).nth(1).unwrap().lines().next().unwrap().parse().unwrap() };
    let (vertices, faces) = (count("vertex"), count("face"));
    let (points, corners) = bytes[end..].split_at(vertices * 24);
    let float = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let vector = |b: &[u8]| [0, 4, 8].map(|at| float(&b[at..]));
    let index = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize;
    assert_eq!(corners.len(), faces * 13);
    Mesh {
        vertices: points.chunks_exact(24).map(vector).collect(),
        normals: points.chunks_exact(24).map(|v| vector(&v[12..])).collect(),
        triangles: corners.chunks_exact(13).map(|t| [1, 5, 9].map(|at| index(&t[at..]))).collect(),
    }
}

impl Mesh {
    fn corners(&self, triangle: [usize; 3]) -> [Vector; 3] {
        triangle.map(|i| self.vertices[i])
    }

    fn area(&self) -> f64 {
        let double = |t: &[usize; 3]| {
            let [a, b, c] = self.corners(*t);
            let n = cross(sub(b, a), sub(c, a));
            dot(n, n).sqrt()
        };
        self.triangles.iter().map(double).sum::<f64>() / 2.0
    }

    /// Positive when triangles are counter-clockwise from outside.
    fn volume(&self) -> f64 {
        self.triangles.iter().map(|t| self.corners(*t)).map(|[a, b, c]| dot(a, cross(b, c))).sum::<f64>() / 6.0
    }

    /// Vertices − edges + triangles.
    fn euler(&self) -> i64 {
        let mut edges: Vec<[usize; 2]> = self.sides().map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        edges.dedup();
        self.vertices.len() as i64 - edges.len() as i64 + self.triangles.len() as i64
    }

    fn sides(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]])
    }

    /// Every side is there once, and once in the other direction; every vertex belongs to a triangle.
    fn assert_watertight(&self) {
        let mut sides: HashMap<[usize; 2], u32> = HashMap::new();
        self.sides().for_each(|side| *sides.entry(side).or_default() += 1);
        assert!(sides.values().all(|n| *n == 1), "a side belongs to two triangles of one orientation");
        assert!(sides.keys().all(|[a, b]| sides.contains_key(&[*b, *a])), "a side is open");
        let mut used = vec![false; self.vertices.len()];
        self.triangles.iter().flatten().for_each(|i| used[*i] = true);
        assert!(used.into_iter().all(|u| u), "a vertex belongs to no triangle");
    }
}

#[test]
fn the_mesh_of_a_sphere_is_a_sphere() {
    let r = 0.35;
    let ball = mesh(
        r#""ball": VolumeShape(resolution: 64, size: 0.35, softness: 0.2),
           "mesh": MarchingCubes(volume: "ball")"#,
    );
    ball.assert_watertight();
    assert_eq!(ball.euler(), 2);
    let (area, volume) = (4.0 * std::f64::consts::PI * r * r, 4.0 / 3.0 * std::f64::consts::PI * r * r * r);
    assert!((ball.area() / area - 1.0).abs() < 3e-3, "area {}, not {area}", ball.area());
    assert!((ball.volume() / volume - 1.0).abs() < 3e-3, "volume {}, not {volume}", ball.volume());
    for (vertex, normal) in ball.vertices.iter().zip(&ball.normals) {
        let out = sub(*vertex, [0.5; 3]);
        let distance = dot(out, out).sqrt();
        assert!((distance - r).abs() < 2e-4, "a vertex at {distance} from the centre");
        assert!(dot(out, *normal) / distance > 0.999, "a normal {normal:?} at {out:?}");
    }
}

#[test]
fn the_mesh_of_a_torus_has_a_hole() {
    let ring = mesh(
        r#""ring": VolumeShape(shape: Torus, resolution: [64, 64, 32], size: 0.3, softness: 0.1),
           "mesh": MarchingCubes(volume: "ring", extent: (10, 20, 15))"#,
    );
    ring.assert_watertight();
    assert_eq!(ring.euler(), 0);
    let volume = 2.0 * std::f64::consts::PI.powi(2) * 0.3 * 0.1 * 0.1 * 3000.0;
    assert!((ring.volume() / volume - 1.0).abs() < 0.02, "volume {}, not {volume}", ring.volume());
}

/// The preset `mesh` on a scan of a ball of 3 mm, whose voxels are 0.5 mm by 0.25 mm by 0.4 mm.
#[test]
fn the_mesh_of_a_scan_has_its_size() {
    use pipe_io::volume::{Volume, Voxel, write};
    let (size, spacing) = ([20_u32, 40, 25], [0.5_f32, 0.25, 0.4]);
    let folder = tempfile::tempdir().unwrap();
    let mut floats = Vec::new();
    for z in 0..size[2] {
        for y in 0..size[1] {
            for x in 0..size[0] {
                let squared: f32 =
                    [x, y, z].iter().zip(size).zip(spacing).map(|((i, n), d)| ((*i as f32 + 0.5 - n as f32 / 2.0) * d).powi(2)).sum();
                floats.push((0.3 + 0.2 * (3.0 - squared.sqrt())).clamp(0.0, 1.0));
            }
        }
    }
    write(&folder.path().join("ball.nrrd"), &Volume::of_floats(size, 1, spacing, &floats, Voxel::F32)).unwrap();
    let mut session = Session::open(&pipe_gpu::Choice::parse(&std::env::var("PIPE_DEVICE").unwrap_or_default()), None).unwrap();
    let file = |name: &str| folder.path().join(name).display().to_string();
    let mut job = Job::new("mesh");
    job.settings = vec![("smooth".to_owned(), "0".to_owned())];
    job.bind_input("in", &file("ball.nrrd"));
    job.bind_output("out", &file("ball.ply")).unwrap();
    session.run(&job).unwrap_or_else(|e| panic!("{e}"));
    let ball = read_ply(&folder.path().join("ball.ply"));
    ball.assert_watertight();
    let volume = 4.0 / 3.0 * std::f64::consts::PI * 27.0;
    assert!((ball.volume() / volume - 1.0).abs() < 0.02, "volume {}, not {volume}", ball.volume());
    let lengths = ball.vertices.iter().map(|v| sub(*v, [5.0; 3])).map(|v| dot(v, v).sqrt());
    assert!(lengths.into_iter().all(|r| (r - 3.0).abs() < 0.05));
}

/// Noise meets every ambiguous case, and the faces of the cube; a black border closes it there.
#[test]
fn the_mesh_of_noise_is_watertight() {
    let noise = mesh(
        r#""noise": VolumeNoise(resolution: [40, 33, 27], frequency: 19, octaves: 1, seed: 5),
           "mesh": MarchingCubes(volume: "noise", iso: 0.52, options: (border: Black))"#,
    );
    assert!(noise.triangles.len() > 30_000, "{} triangles", noise.triangles.len());
    noise.assert_watertight();
    assert!(noise.volume() > 0.0);
}

#[test]
fn a_mesh_without_room_says_what_it_needs() {
    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("mesh.ron");
    let nodes = r#""ball": VolumeShape(), "mesh": MarchingCubes(volume: "ball", max_triangles: 100)"#;
    std::fs::write(&graph, graph_text(nodes, r#""out": "mesh""#)).unwrap();
    let mut session = Session::open(&pipe_gpu::Choice::parse(&std::env::var("PIPE_DEVICE").unwrap_or_default()), None).unwrap();
    let mut job = Job::new(&graph.display().to_string());
    let obj = folder.path().join("mesh.obj");
    job.bind_output("out", &obj.display().to_string()).unwrap();
    let error = session.run(&job).unwrap_err().to_string();
    assert!(error.contains("room for") && error.contains("max_triangles"), "{error}");
    assert!(!obj.exists());
}

#[test]
fn a_volume_larger_than_the_budget_says_so_before_it_is_made() {
    let text = graph_text(r#""body": VolumeShape(resolution: 512)"#, r#""out": "body""#);
    let graph = compile(&text, &[]).unwrap();
    let EdgeType::Volume(ty) = graph.ty(graph.outputs().next().unwrap().1) else { panic!("it is a volume") };
    assert_eq!(ty.size, [512; 3]);
    let limits = Limits { budget: Some(300 << 20), ..Default::default() };
    let error = pipe_tests::bench::plan(&graph, &limits, &pipe_plan::Options { budget: limits.budget, ..Default::default() }).unwrap_err();
    assert!(error.contains("MiB") || error.contains("GiB"), "{error}");
}

#[test]
fn files_that_cannot_hold_an_output_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("all.ron");
    let nodes = r#""v": VolumeShape(resolution: 8), "m": MarchingCubes(volume: "v"), "s": VolumeSlice(volume: "v")"#;
    std::fs::write(&graph, graph_text(nodes, r#""volume": "v", "mesh": "m", "image": "s""#)).unwrap();
    let mut session = Session::open(&pipe_gpu::Choice::parse(&std::env::var("PIPE_DEVICE").unwrap_or_default()), None).unwrap();
    for (output, file, what) in [
        ("volume", "a.png", "`volume` is Volume 8x8x8, 1 channel, which `a.png` cannot hold"),
        ("mesh", "a.nrrd", "end the file's name in one of .obj .ply"),
        ("image", "a.ply", "`image` is Image 8x8"),
    ] {
        let mut job = Job::new(&graph.display().to_string());
        job.bind_output(output, file).unwrap();
        let error = session.run(&job).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
}

/// Values of `scipy.ndimage` 1.17: `gaussian_filter(v, 0.8, radius=3)` with modes nearest and wrap, `zoom(v, 2, order=1,
/// mode="nearest", grid_mode=True)`, and of `numpy.gradient`.
#[test]
fn filters_agree_with_scipy() {
    let size = [7, 5, 4];
    let block = Block::from_fn(size, 1, |x, y, z| [f64::from(((3 * x + 5 * y + 7 * z) % 11) as f32 / 11.0); 4]);
    let nodes = r#""blur": VolumeBlur(volume: "v", sigma: 0.8), "wrap": VolumeBlur(volume: "v", sigma: 0.8, options: (border: Repeat)),
        "zoom": VolumeResample(volume: "v", resolution: [14, 10, 8]), "shrink": VolumeResample(volume: "v", resolution: [7, 5, 2]),
        "gradient": VolumeGradient(volume: "v")"#;
    let outputs = ["blur", "wrap", "zoom", "shrink", "gradient"].map(|n| format!(r#""{n}": "{n}""#)).join(", ");
    let text = format!(r#"Graph(version: 1, inputs: {{"v": Volume}}, nodes: {{{nodes}}}, outputs: {{{outputs}}})"#);
    let graph = compile(&text, &[("v", EdgeType::volume(size, 1))]).unwrap_or_else(|e| panic!("{e}"));
    let values = Bench::new().gpu(&graph, &|_| Tensor::Volume(block.clone())).unwrap();
    let check = |name: &str, size: [usize; 2], points: &[[usize; 3]], expected: &[f64]| {
        for ([x, y, z], expected) in points.iter().zip(expected) {
            let got = values[name][(z * size[1] + y) * size[0] + x];
            assert!((got - expected).abs() < 1e-6, "{name} at {x}, {y}, {z}: {got}, not {expected}");
        }
    };
    let points = [[0, 0, 0], [3, 2, 1], [6, 4, 3], [5, 0, 2]];
    check("blur", [7, 5], &points, &[0.2790582, 0.4475671, 0.458806, 0.4424081]);
    check("wrap", [7, 5], &points, &[0.4297193, 0.449155, 0.4692885, 0.4416446]);
    check("zoom", [14, 10], &[[0, 0, 0], [7, 4, 3], [13, 9, 7], [6, 1, 5]], &[0.0, 0.4303977, 0.3636364, 0.3892045]);
    check("shrink", [7, 5], &[[0, 0, 0], [3, 2, 1], [6, 4, 0]], &[0.2727273, 0.3636364, 0.3522727]);
    let at = 4 * ((5 + 2) * 7 + 3);
    for (got, expected) in values["gradient"][at..at + 3].iter().zip([1.9090909, -0.2272727, -1.4545455]) {
        assert!((got - expected).abs() < 1e-5, "gradient: {got}, not {expected}");
    }
}

/// Some drivers end an invocation silently after 65,535 turns of all its loops: the longest that fields allow must do.
#[test]
fn the_longest_loops_come_to_their_end() {
    // Brighter away from the eye, and so few slices that no brick can be leapt over.
    let ramp = |size: [u32; 3]| {
        Block::from_fn(size, 1, |x, y, z| [f64::from((0.9 - (z as f32 - x as f32 * 0.001 + y as f32 * 0.01) / size[2] as f32).abs()); 4])
    };
    let camera = "camera: (size: (8, 128))";
    for (size, node, port) in [
        ([5, 4, 7], format!(r#"MaximumIntensity(volume: "v", steps: 4096, {camera})"#), "out"),
        ([5, 4, 7], format!(r#"Isosurface(volume: "v", iso: 0.8, steps: 4096, {camera})"#), "depth"),
        ([5, 4, 7], format!(r#"VolumeRender(volume: "v", steps: 4096, alpha_exponent: 0.001, alpha_center: 500, {camera})"#), "out"),
        ([600, 3, 2], r#"VolumeBlur(volume: "v", sigma: 100)"#.to_owned(), "out"),
        ([2048, 3, 2], r#"VolumeResample(volume: "v", resolution: 1)"#.to_owned(), "out"),
    ] {
        let text = format!(r#"Graph(version: 1, inputs: {{"v": Volume}}, nodes: {{"n": {node}}}, outputs: {{"out": "n.{port}"}})"#);
        let graph = compile(&text, &[("v", EdgeType::volume(size, 1))]).unwrap_or_else(|e| panic!("{e}"));
        let input = |_: &str| Tensor::Volume(ramp(size));
        let (got, expected) = (Bench::new().gpu(&graph, &input).unwrap(), reference(&graph, &input));
        let off = got["out"].iter().zip(&expected["out"]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-3, "{node}: off by {off}");
    }
    let row = mesh(
        r#""noise": VolumeNoise(resolution: [2046, 4, 4], frequency: 900, octaves: 1),
           "mesh": MarchingCubes(volume: "noise", options: (border: Black))"#,
    );
    row.assert_watertight();
    assert!(row.vertices.iter().any(|v| v[0] > 0.999), "the walk along a row ends early");
}

/// Buffers that a shader binds have a largest size: volumes cross the rim in bands of slices.
#[test]
fn volumes_cross_the_rim_in_bands() {
    let graph = r#"Graph(version: 1, inputs: {"volume": Volume}, nodes: {}, outputs: {"out": "volume"})"#;
    let graph = compile(graph, &[("volume", edge_type("volume", [1, 1]))]).unwrap();
    let mut bench = Bench::new();
    let input = |name: &str| edge(name, [1, 1]);
    for max_binding_bytes in [7_000, 13_000, 1 << 20] {
        let limits = Limits { max_binding_bytes, ..bench.limits() };
        let plan = pipe_tests::bench::plan(&graph, &limits, &pipe_plan::Options::default()).unwrap();
        let got = bench.run(&graph, plan, &input).unwrap();
        let Tensor::Volume(block) = input("volume") else { panic!("it is a volume") };
        let expected: Vec<f64> = block.voxels.iter().map(|v| v[0]).collect();
        assert_eq!(got["out"], expected, "in bindings of {max_binding_bytes} bytes");
    }
}

/// Proportions of scans: the spacing in a file's header is known to expressions.
#[test]
fn expressions_know_the_spacing_of_voxels() {
    use pipe_io::volume::{Volume, Voxel, write};
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).display().to_string();
    let nodes = r#""v": VolumeSlice(volume: "in"), "c": Constant(color: ("=in.dx", "=in.dy", "=in.dz*in.depth", 1), size: (1, 1))"#;
    let text = format!(r#"Graph(version: 1, inputs: {{"in": Volume}}, nodes: {{{nodes}}}, outputs: {{"out": "c", "slice": "v"}})"#);
    std::fs::write(folder.path().join("spacing.ron"), text).unwrap();
    let volume = Volume::of_floats([2, 3, 4], 1, [0.5, 0.75, 2.0], &[0.0; 24], Voxel::F32);
    write(&folder.path().join("in.nrrd"), &volume).unwrap();
    let mut session = Session::open(&pipe_gpu::Choice::parse(&std::env::var("PIPE_DEVICE").unwrap_or_default()), None).unwrap();
    let mut job = Job::new(&file("spacing.ron"));
    job.bind_input("in", &file("in.nrrd"));
    job.bind_output("out", &file("out.exr")).unwrap();
    session.run(&job).unwrap_or_else(|e| panic!("{e}"));
    let out = pipe_io::read(&pipe_io::Source::parse(&file("out.exr")), &pipe_io::ReadOptions::default()).unwrap();
    assert_eq!([0, 1, 2].map(|c| out.sample_at(0, 0, c).unwrap()), [0.5, 0.75, 8.0]);
}

/// NRRD in, NPY out: voxels as they were, whatever their type.
#[test]
fn volumes_go_through_a_graph_unchanged() {
    use pipe_io::volume::{Volume, Voxel, read, write};
    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("copy.ron");
    std::fs::write(&graph, r#"Graph(version: 1, inputs: {"in": Volume}, nodes: {}, outputs: {"out": "in"})"#).unwrap();
    let read_graph = folder.path().join("read.ron");
    std::fs::write(&read_graph, graph_text(r#""v": ReadVolume(path: "in.npy")"#, r#""out": "v""#)).unwrap();
    let mut session = Session::open(&pipe_gpu::Choice::parse(&std::env::var("PIPE_DEVICE").unwrap_or_default()), None).unwrap();
    let file = |name: &str| folder.path().join(name).display().to_string();
    let open = |name: &str| read(&pipe_io::Source::parse(&file(name)), &pipe_io::Limits::default()).unwrap();
    for voxel in [Voxel::U8, Voxel::I8, Voxel::U16, Voxel::I16, Voxel::U32, Voxel::I32, Voxel::F16, Voxel::F32] {
        for channels in [1, 4] {
            let floats: Vec<f32> =
                (0..7 * 5 * 3 * i32::from(channels)).map(|i| (i - 40) as f32 * 0.01 * f32::from(u8::from(i % 3 > 0))).collect();
            let floats = if matches!(voxel, Voxel::U32 | Voxel::I32 | Voxel::I16 | Voxel::I8) {
                floats.iter().map(|v| (v * 60.0).round()).collect()
            } else {
                floats
            };
            write(&folder.path().join("in.npy"), &Volume::of_floats([7, 5, 3], channels, [1.0; 3], &floats, voxel)).unwrap();
            let mut job = Job::new(&graph.display().to_string());
            job.bind_input("in", &file("in.npy"));
            job.bind_output("out", &file("out.npy")).unwrap();
            session.run(&job).unwrap_or_else(|e| panic!("{e}"));
            let (given, got) = (open("in.npy"), open("out.npy"));
            assert_eq!((got.header.size, got.header.channels), ([7, 5, 3], channels));
            let off = given.values().iter().zip(got.values()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off <= 1e-7, "{voxel:?} of {channels} channels is off by {off}");
            // A node that reads the file finds it beside the graph.
            let mut job = Job::new(&read_graph.display().to_string());
            job.bind_output("out", &file("again.npy")).unwrap();
            session.run(&job).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(open("again.npy"), got);
        }
    }
}
