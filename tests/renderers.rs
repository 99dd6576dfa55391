//! One scene rendered by single scattering, by gathering walks and from the fluence of photons: pictures that must agree.

use std::f64::consts::PI;

use pipe_graph::reference::Tensor;
use pipe_tests::bench::{Bench, compile};

/// Runs nodes without inputs; answers the values of one of them.
fn run(bench: &mut Bench, nodes: &str, output: &str) -> Vec<f64> {
    let text = format!(r#"Graph(version: 1, inputs: {{}}, nodes: {{{nodes}}}, outputs: {{"out": "{output}"}})"#);
    let graph = compile(&text, &[]).unwrap_or_else(|e| panic!("{text}\n{e}"));
    let nothing = |name: &str| -> Tensor { panic!("there is no {name}") };
    bench.gpu(&graph, &nothing).unwrap_or_else(|e| panic!("{e}")).remove("out").unwrap_or_default()
}

/// The first channel of a picture by this node.
fn radiance(bench: &mut Bench, node: &str) -> Vec<f64> {
    run(bench, &format!(r#""a": {node}"#), "a").chunks_exact(4).map(|p| p[0]).collect()
}

fn mean(v: &[f64]) -> f64 {
    v.iter().sum::<f64>() / v.len() as f64
}

/// Whether two pictures have the same mean, and differ by no more than noise of this size from pixel to pixel.
fn alike(what: &str, a: &[f64], b: &[f64], of_mean: f64, of_pixels: f64) {
    let (x, y) = (mean(a), mean(b));
    assert!((x - y).abs() < of_mean * x, "{what}: means {x} and {y} differ by {:.4}", (x - y).abs() / x);
    let spread = (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt();
    assert!(spread < of_pixels * x, "{what}: pixels differ by {:.4} of the mean", spread / x);
}

const SUN: &str = "light: Plane([0.5, 1, 0.5], [0, -1, 0], 1)";

#[test]
fn single_scattering_is_what_the_integral_says() {
    let mut bench = Bench::new();
    // One ray across a homogeneous medium, at half its height, lit from above: everything is known.
    let camera = "camera: (eye: (0.5, 0.5, 3), size: (1, 1))";
    for (phase, density) in [("Isotropic", 1.0 / (4.0 * PI)), ("Rayleigh", 3.0 / (16.0 * PI))] {
        let fields = format!("medium: Homogeneous(3), {SUN}, {camera}, phase: {phase}, albedo: 0.8");
        let expected = 0.8 * density * (-1.5_f64).exp() * (1.0 - (-3.0_f64).exp());
        let picture = run(&mut bench, &format!(r#""a": SingleScatter({fields})"#), "a");
        assert!((picture[0] / expected - 1.0).abs() < 1e-5, "{picture:?} {expected}");
        assert!((picture[3] - (1.0 - (-3.0_f64).exp())).abs() < 1e-6, "{picture:?}");
        let walks = run(&mut bench, &format!(r#""a": GatherWalk({fields}, paths: 20000, max_bounces: 1)"#), "a");
        assert!((walks[0] / expected - 1.0).abs() < 0.02, "{walks:?} {expected}");
        assert!((walks[3] - picture[3]).abs() < 0.01, "{walks:?}");
    }
}

#[test]
fn one_bounce_of_a_walk_is_single_scattering() {
    let mut bench = Bench::new();
    for (medium, light, phase) in
        [("Homogeneous(4)", "Point([0.2, 1.3, 1.4])", "HenyeyGreenstein(0.5)"), ("CloudChamber(4)", "Point([0.5, 0.9, 0.5])", "Rayleigh")]
    {
        let fields = format!("medium: {medium}, light: {light}, phase: {phase}, camera: (eye: (0.6, 0.5, 0.9), fov: 60, size: (12, 12))");
        let single = radiance(&mut bench, &format!("SingleScatter({fields}, steps: 400)"));
        let walks = radiance(&mut bench, &format!("GatherWalk({fields}, paths: 1500, max_bounces: 1)"));
        alike(medium, &single, &walks, 0.02, 0.25);
    }
}

#[test]
fn fluence_of_photons_looks_like_what_walks_find() {
    let mut bench = Bench::new();
    let scene = format!("medium: Homogeneous(5), {SUN}");
    let camera = "camera: (eye: (1.6, 0.9, 2.2), size: (10, 10))";
    let walks = radiance(&mut bench, &format!("GatherWalk({scene}, {camera}, paths: 1500)"));
    for estimator in ["Collision", "TrackLength"] {
        let photons = run(
            &mut bench,
            &format!(
                r#""p": PhotonScatter({scene}, resolution: 24, photons: 400000, estimator: {estimator}),
                "a": VolumeRadiance(fluence: "p", medium: Homogeneous(5), {camera})"#
            ),
            "a",
        );
        let photons: Vec<f64> = photons.chunks_exact(4).map(|p| p[0]).collect();
        alike(estimator, &walks, &photons, 0.02, 0.06);
    }
}

/// Radiance from all sides is fluence: six pictures from the middle of the cube against the photons that pass there.
#[test]
fn radiance_from_all_sides_is_the_fluence_of_photons() {
    let mut bench = Bench::new();
    let n = 8;
    for (medium, phase) in [("Homogeneous(4)", "HenyeyGreenstein(0.7)"), ("Homogeneous(4)", "Rayleigh")] {
        let mut around = 0.0;
        for (side, up) in [
            ("1.5, 0.5, 0.5", "0, 1, 0"),
            ("-0.5, 0.5, 0.5", "0, 1, 0"),
            ("0.5, 1.5, 0.5", "1, 0, 0"),
            ("0.5, -0.5, 0.5", "1, 0, 0"),
            ("0.5, 0.5, 1.5", "0, 1, 0"),
            ("0.5, 0.5, -0.5", "0, 1, 0"),
        ] {
            let camera = format!("camera: (eye: (0.5, 0.5, 0.5), target: ({side}), up: ({up}), fov: 90, size: ({n}, {n}))");
            let picture = radiance(&mut bench, &format!("GatherWalk(medium: {medium}, {SUN}, phase: {phase}, {camera}, paths: 2000)"));
            for (i, value) in picture.iter().enumerate() {
                let at = |k: usize| (k as f64 + 0.5) * 2.0 / f64::from(n) - 1.0;
                let (u, v) = (at(i % n as usize), at(i / n as usize));
                around += value * 4.0 / f64::from(n * n) * (1.0 + u * u + v * v).powf(-1.5);
            }
        }
        let fields = format!("medium: {medium}, {SUN}, phase: {phase}, resolution: 9, photons: 600000, estimator: TrackLength");
        let middle = run(&mut bench, &format!(r#""p": PhotonScatter({fields})"#), "p")[4 * 81 + 4 * 9 + 4];
        // The light itself is not in the pictures.
        let scattered = middle - (-2.0_f64).exp();
        assert!((around / scattered - 1.0).abs() < 0.03, "{phase}: {around} around, {scattered} of photons");
    }
}

#[test]
fn walks_are_the_same_twice() {
    let mut bench = Bench::new();
    let node = "GatherWalk(medium: CloudChamber, light: Point([0.5, 0.9, 0.5]), camera: (eye: (0.5, 0.5, 0.9), size: (9, 9)), paths: 5)";
    assert_eq!(radiance(&mut bench, node), radiance(&mut bench, node));
}

#[test]
fn a_beam_cannot_be_asked_for_its_light() {
    let text = r#"Graph(version: 1, inputs: {}, nodes: {"a": SingleScatter(light: Beam([0, 0, 0], [1, 1, 1]))}, outputs: {"out": "a"})"#;
    let message = compile(text, &[]).err().unwrap_or_default();
    assert!(message.contains("a beam has no width"), "{message}");
}
