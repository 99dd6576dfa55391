//! Light in media: photons against formulas, published tables and each other.

use pipe_graph::pass::Limits;
use pipe_graph::prelude::*;
use pipe_plan::Options;
use pipe_tests::bench::{Bench, Values, compile, plan};

/// Runs a PhotonScatter with these fields and answers all of its ports. `fog` is a volume of σt = 4 everywhere, `cloud`
/// one that varies.
fn photons(bench: &mut Bench, fields: &str) -> Values {
    run(bench, &format!(r#""p": PhotonScatter({fields}),"#), "p")
}

/// Runs a graph and answers all ports of its PhotonScatter of this name.
fn run(bench: &mut Bench, nodes: &str, name: &str) -> Values {
    let ports = ["fluence", "deposited", "absorbed", "escaped", "faces", "alive", "error", "tallies"];
    let outputs: String = ports.iter().map(|p| format!(r#""{p}": "{name}.{p}", "#)).collect();
    let named: Vec<(&str, EdgeType)> =
        ["fog", "cloud"].into_iter().filter(|n| nodes.contains(&format!("\"{n}\""))).map(|n| (n, EdgeType::volume([8, 8, 8], 1))).collect();
    let inputs: String = named.iter().map(|(n, _)| format!(r#""{n}": Volume, "#)).collect();
    let text = format!("Graph(version: 1, inputs: {{{inputs}}}, nodes: {{{nodes}}}, outputs: {{{outputs}}})");
    let graph = compile(&text, &named);
    let graph = graph.unwrap_or_else(|e| panic!("{text}\n{e}"));
    bench.gpu(&graph, &volume).unwrap_or_else(|e| panic!("{e}"))
}

fn volume(name: &str) -> Tensor {
    Tensor::Volume(Block::from_fn([8, 8, 8], 1, |x, y, z| {
        let varies = 2.0 + (x as f64 * 0.8).sin() + (y as f64 * 0.5).cos() * (z as f64 * 0.6).sin();
        let v = if name == "fog" { 4.0 } else { f64::from((2.0 * varies) as f32) };
        [v, v, v, 1.0]
    }))
}

/// Whether two estimates differ by at most this many standard errors of their difference.
fn agree(what: &str, a: f64, b: f64, error: f64, most: f64) {
    assert!((a - b).abs() <= most * error, "{what}: {a} and {b} are {:.2} standard errors of {error} apart", (a - b).abs() / error);
}

/// Mean of the squared differences of two fluences in standard errors, over voxels that many photons pass.
fn mean_square_difference(a: &Values, b: &Values) -> f64 {
    let largest = a["fluence"].iter().copied().fold(0.0, f64::max);
    let mut squares = Vec::new();
    for i in 0..a["fluence"].len() {
        let error = a["error"][i].hypot(b["error"][i]);
        if a["fluence"][i] > 0.02 * largest {
            squares.push(((a["fluence"][i] - b["fluence"][i]) / error).powi(2));
        }
    }
    assert!(squares.len() > 20, "only {} voxels are bright", squares.len());
    squares.iter().sum::<f64>() / squares.len() as f64
}

const POINT: &str = "light: Point([0.5, 0.5, 0.5])";

#[test]
fn energy_is_kept_whatever_the_options() {
    let mut bench = Bench::new();
    let media = ["Homogeneous(10)", "\"cloud\"", "CloudChamber", "Homogeneous(0)"];
    let lights = ["Point([0.4, 0.9, 0.5])", "Beam([-1, 0.3, 0.5], [1, 0.1, 0])", "Plane([0.5, 1.5, 0.5], [0.1, -1, 0], 2)"];
    let phases = ["Isotropic", "Rayleigh", "HenyeyGreenstein(0.8)"];
    for (i, medium) in media.iter().enumerate() {
        for (j, light) in lights.iter().enumerate() {
            for tracking in ["March", "Delta"] {
                let (phase, boundary) = (phases[(i + j) % 3], ["Absorb", "PeriodicXZ"][(i + j) % 2]);
                let (estimator, random) = (["Collision", "TrackLength"][j % 2], ["Counter", "Tausworthe"][i % 2]);
                let (albedo, energy) = ([0.0, 0.5, 1.0][(i + 2 * j) % 3], [0.0, 0.3, 1.0][j]);
                let fields = format!(
                    "medium: {medium}, light: {light}, tracking: {tracking}, phase: {phase}, boundary: {boundary}, estimator: {estimator}, \
                     random: {random}, albedo: {albedo}, min_energy: {energy}, resolution: [5, 4, 3], photons: 777, batches: 3"
                );
                let v = photons(&mut bench, &fields);
                let sum = v["absorbed"][0] + v["escaped"][0] + v["alive"][0];
                assert!((sum - 1.0).abs() < 1e-6, "{fields}: {sum}");
                assert!((v["deposited"].iter().sum::<f64>() - v["absorbed"][0]).abs() < 1e-5, "{fields}");
                assert!((v["faces"].iter().sum::<f64>() - v["escaped"][0]).abs() < 1e-6, "{fields}");
                assert!(v.values().flatten().all(|x| x.is_finite()), "{fields}");
            }
        }
    }
}

#[test]
fn without_scattering_light_falls_off_as_beer_and_lambert_say() {
    let mut bench = Bench::new();
    let n = 200_000.0_f64;
    let base = "light: Beam([0, 0.5, 0.5], [1, 0, 0]), albedo: 0, resolution: [8, 1, 1], photons: 200000";
    for medium in ["medium: Homogeneous(4)", r#"medium: "fog""#, r#"medium: "fog", tracking: Delta"#] {
        let v = photons(&mut bench, &format!("{medium}, {base}"));
        let at = |x: f64| (-4.0 * x).exp();
        for slice in 0..8 {
            let share = at(slice as f64 / 8.0) - at((slice + 1) as f64 / 8.0);
            let error = (share * (1.0 - share) / n).sqrt();
            agree(&format!("{medium}, slice {slice}"), v["deposited"][slice], share, error, 3.0);
            // Each absorbed photon has collided once, and fluence is collisions by σt.
            agree(&format!("{medium}, fluence {slice}"), v["fluence"][slice], share * 8.0 / 4.0, error * 8.0 / 4.0, 3.0);
        }
        agree(medium, v["faces"][1], at(1.0), (at(1.0) / n).sqrt(), 3.0);
    }
    // The lengths of paths have less noise: ∫exp(−4x)dx over each slice.
    let v = photons(&mut bench, &format!("medium: Homogeneous(4), {base}, estimator: TrackLength"));
    for slice in 0..8 {
        let mean = (at_depth(slice) - at_depth(slice + 1)) / 4.0 * 8.0;
        agree("path lengths", v["fluence"][slice], mean, v["error"][slice], 4.0);
    }
}

fn at_depth(slice: usize) -> f64 {
    (-0.5 * slice as f64).exp()
}

/// Total reflectance and transmittance of a slab that is lit squarely, its refractive index matched.
fn slab(bench: &mut Bench, thickness: f64, albedo: f64, g: f64, photons_: u32, seed: u32) -> [f64; 2] {
    let fields = format!(
        "medium: Homogeneous({thickness}), albedo: {albedo}, phase: HenyeyGreenstein({g}), boundary: PeriodicXZ, \
         light: Plane([0.5, 1, 0.5], [0, -1, 0], 1), resolution: 1, photons: {photons_}, seed: {seed}"
    );
    let v = photons(bench, &fields);
    [v["faces"][3], v["faces"][2]]
}

/// H. C. van de Hulst, Multiple Light Scattering, 1980, volume 2, table 35: the first check of MCML (L. Wang, S. Jacques,
/// L. Zheng 1995, table 4.1), R = 0.09739 and T = 0.66096. A photon leaves a weight of spread below ½ on either side.
#[test]
fn a_slab_reflects_and_transmits_as_published() {
    let mut bench = Bench::new();
    let n = 400_000;
    let error = 0.25 / f64::from(n).sqrt();
    let [r, t] = slab(&mut bench, 2.0, 0.9, 0.75, n, 1);
    agree("reflectance", r, 0.09739, error, 3.0);
    agree("transmittance", t, 0.66096, 1.5 * error, 3.0);
}

#[test]
#[ignore = "ten million photons"]
fn a_slab_reflects_and_transmits_as_published_to_four_digits() {
    let mut bench = Bench::new();
    let n = 10_000_000;
    let error = 0.25 / f64::from(n).sqrt();
    let [r, t] = slab(&mut bench, 2.0, 0.9, 0.75, n, 2);
    println!("R = {r:.6}, T = {t:.6}");
    agree("reflectance", r, 0.09739, error, 3.0);
    agree("transmittance", t, 0.66096, 1.5 * error, 3.0);
}

/// Chandrasekhar's H function of isotropic scattering, from its integral equation (Radiative Transfer, 1960, section 38).
fn chandrasekhar_h(albedo: f64, mu: f64) -> f64 {
    let n = 400;
    let nodes: Vec<f64> = (0..n).map(|i| (f64::from(i) + 0.5) / f64::from(n)).collect();
    let next = |h: &[f64], mu: f64| {
        let integral: f64 = nodes.iter().zip(h).map(|(m, h)| m * h / (mu + m) / f64::from(n)).sum();
        1.0 / ((1.0 - albedo).sqrt() + 0.5 * albedo * integral)
    };
    let mut h = vec![1.0; nodes.len()];
    for _ in 0..100 {
        h = nodes.iter().map(|mu| next(&h, *mu)).collect();
    }
    next(&h, mu)
}

/// A half-space that scatters isotropically reflects 1 − √(1 − albedo)·H(1) of light that meets it squarely.
#[test]
fn a_half_space_reflects_what_chandrasekhar_says() {
    let mut bench = Bench::new();
    assert!((chandrasekhar_h(0.9, 1.0) - 1.8501).abs() < 1e-3, "{}", chandrasekhar_h(0.9, 1.0));
    for albedo in [0.5, 0.9, 0.99] {
        let n = 200_000;
        let [r, t] = slab(&mut bench, 200.0, albedo, 0.0, n, 4);
        let expected = 1.0 - (1.0 - albedo).sqrt() * chandrasekhar_h(albedo, 1.0);
        agree(&format!("albedo {albedo}"), r, expected, 0.45 / f64::from(n).sqrt(), 3.0);
        assert!(t < 1e-4);
    }
}

/// Isotropic scattering without absorption: what is not reflected is transmitted.
#[test]
fn a_slab_that_absorbs_nothing_keeps_nothing() {
    let [r, t] = slab(&mut Bench::new(), 5.0, 1.0, 0.0, 50_000, 3);
    assert!((r + t - 1.0).abs() < 1e-6);
    assert!(r > 0.7 && r < 0.85, "{r}");
}

#[test]
fn marching_and_delta_tracking_agree() {
    let mut bench = Bench::new();
    for (medium, light) in [("\"cloud\"", POINT), ("CloudChamber", "light: Point([0.5, 0.9, 0.5])")] {
        let base = format!("medium: {medium}, {light}, resolution: 6, photons: 100000, batches: 32");
        let march = photons(&mut bench, &base);
        let delta = photons(&mut bench, &format!("{base}, tracking: Delta, seed: 1"));
        let square = mean_square_difference(&march, &delta);
        assert!((0.6..1.5).contains(&square), "{medium}: {square}");
        agree(medium, march["absorbed"][0], delta["absorbed"][0], 0.5 / 100_000.0_f64.sqrt(), 4.0);
    }
}

#[test]
fn collisions_and_paths_estimate_the_same_fluence() {
    let mut bench = Bench::new();
    for (medium, phase) in [("Homogeneous(5)", "HenyeyGreenstein(0.5)"), ("\"cloud\"", "Rayleigh")] {
        let base = format!("medium: {medium}, {POINT}, phase: {phase}, resolution: 6, photons: 100000, batches: 32");
        let collisions = photons(&mut bench, &base);
        let paths = photons(&mut bench, &format!("{base}, estimator: TrackLength, seed: 1"));
        let square = mean_square_difference(&collisions, &paths);
        assert!((0.6..1.5).contains(&square), "{medium}: {square}");
    }
}

/// What is absorbed is (1 − albedo)·∫σt·Φ.
#[test]
fn fluence_is_absorbed_as_the_medium_says() {
    let mut bench = Bench::new();
    for estimator in ["Collision", "TrackLength"] {
        let fields =
            format!("medium: Homogeneous(6), {POINT}, albedo: 0.7, resolution: [4, 5, 6], photons: 100000, estimator: {estimator}");
        let v = photons(&mut bench, &fields);
        let absorbed = 0.3 * 6.0 * v["fluence"].iter().sum::<f64>() / 120.0;
        assert!((absorbed / v["absorbed"][0] - 1.0).abs() < 0.01, "{estimator}: {absorbed} {}", v["absorbed"][0]);
    }
}

#[test]
fn a_constant_volume_is_a_homogeneous_medium() {
    let mut bench = Bench::new();
    let base = format!("{POINT}, resolution: 4, photons: 2000");
    let exact = photons(&mut bench, &format!("medium: Homogeneous(4), {base}"));
    for tracking in ["March", "Delta"] {
        // The same photons, so nothing but rounding differs.
        let volume = photons(&mut bench, &format!(r#"medium: "fog", {base}, tracking: {tracking}"#));
        for i in 0..64 {
            assert!((exact["fluence"][i] - volume["fluence"][i]).abs() < 0.01 * exact["fluence"][i], "{tracking} {i}");
        }
        assert!((exact["absorbed"][0] - volume["absorbed"][0]).abs() < 1e-3);
    }
}

#[test]
fn both_generators_tell_the_same() {
    let mut bench = Bench::new();
    let base = format!("medium: Homogeneous(5), {POINT}, resolution: 6, photons: 100000, batches: 32");
    let counter = photons(&mut bench, &base);
    let hybrid = photons(&mut bench, &format!("{base}, random: Tausworthe"));
    let square = mean_square_difference(&counter, &hybrid);
    assert!((0.6..1.5).contains(&square), "{square}");
}

#[test]
fn roulette_changes_no_mean() {
    let mut bench = Bench::new();
    let base = format!("medium: Homogeneous(8), {POINT}, resolution: 5, photons: 60000, batches: 32");
    let weights = photons(&mut bench, &format!("{base}, min_energy: 0"));
    for energy in ["0.01", "0.5", "1"] {
        let roulette = photons(&mut bench, &format!("{base}, min_energy: {energy}, seed: 1"));
        let square = mean_square_difference(&weights, &roulette);
        assert!((0.5..1.6).contains(&square), "{energy}: {square}");
    }
}

#[test]
fn the_standard_error_is_the_spread_of_repetitions() {
    let mut bench = Bench::new();
    let base = format!("medium: Homogeneous(5), {POINT}, resolution: 3, photons: 5000, batches: 64");
    let runs: Vec<Values> = (0..24).map(|seed| photons(&mut bench, &format!("{base}, seed: {seed}"))).collect();
    let n = runs.len() as f64;
    let (mut spread, mut claimed) = (0.0, 0.0);
    for i in 0..27 {
        let mean = runs.iter().map(|r| r["fluence"][i]).sum::<f64>() / n;
        spread += runs.iter().map(|r| (r["fluence"][i] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        claimed += runs.iter().map(|r| r["error"][i].powi(2)).sum::<f64>() / n;
    }
    assert!((0.8..1.25).contains(&(spread / claimed)), "{spread} {claimed}");
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    let mut bench = Bench::new();
    let base = format!("medium: CloudChamber, {POINT}, resolution: 5, photons: 5000, seed: 9");
    let first = photons(&mut bench, &base);
    assert_eq!(first, photons(&mut bench, &base), "twice in a row");
    for batches in [1, 3, 7] {
        let other = photons(&mut bench, &format!("{base}, batches: {batches}"));
        for port in ["fluence", "deposited", "absorbed", "escaped", "faces"] {
            assert_eq!(first[port], other[port], "{port} in {batches} batches");
        }
    }
    assert_ne!(first, photons(&mut bench, &base.replace("seed: 9", "seed: 10")));
}

/// Other numbers of threads and other lengths of dispatches, on the same device.
#[test]
fn how_work_is_cut_into_dispatches_changes_no_bit() {
    let mut bench = Bench::new();
    let camera = "camera: (eye: (0.6, 0.5, 0.9), fov: 60, size: (140, 120))";
    for node in [
        format!("PhotonScatter(medium: CloudChamber, {POINT}, resolution: 5, photons: 9000, tracking: Delta, batches: 2)"),
        format!("PhotonScatter(medium: Homogeneous(9), {POINT}, resolution: 5, photons: 9000, random: Tausworthe, estimator: TrackLength)"),
        format!("GatherWalk(medium: CloudChamber, light: Point([0.5, 0.9, 0.5]), {camera}, paths: 2, max_bounces: 8)"),
    ] {
        let text = format!(r#"Graph(version: 1, inputs: {{}}, nodes: {{"a": {node}}}, outputs: {{"out": "a"}})"#);
        let graph = compile(&text, &[]).unwrap_or_else(|e| panic!("{e}"));
        let [gpu, cpu] = [Profile::Gpu, Profile::Cpu].map(|profile| {
            let limits = Limits { profile, ..bench.limits() };
            let plan = plan(&graph, &limits, &Options::default()).unwrap_or_else(|e| panic!("{e}"));
            bench.run(&graph, plan, &volume).unwrap_or_else(|e| panic!("{e}"))
        });
        assert_eq!(gpu, cpu, "{node}");
    }
}

/// All paths end in the same step, so that more threads ask for the last pixel of a slice than there are pixels.
#[test]
fn threads_that_come_too_late_for_a_pixel_leave_the_next_ones() {
    let mut bench = Bench::new();
    for (profile, width, height) in [(Profile::Cpu, 141, 121), (Profile::Gpu, 1061, 1011)] {
        let camera = format!("camera: (eye: (0.6, 0.5, 0.9), fov: 60, size: ({width}, {height}))");
        let node = format!("GatherWalk(medium: Homogeneous(0), light: Point([0.5, 0.9, 0.5]), {camera}, paths: 1)");
        let text = format!(r#"Graph(version: 1, inputs: {{}}, nodes: {{"a": {node}}}, outputs: {{"out": "a"}})"#);
        let graph = compile(&text, &[]).unwrap_or_else(|e| panic!("{e}"));
        let limits = Limits { profile, ..bench.limits() };
        let plan = plan(&graph, &limits, &Options::default()).unwrap_or_else(|e| panic!("{e}"));
        let picture = bench.run(&graph, plan, &volume).unwrap_or_else(|e| panic!("{e}"));
        assert!(picture["out"].len() == 4 * width * height && picture["out"].iter().all(|v| *v == 0.0));
    }
}

#[test]
fn more_photons_can_be_added_to_an_earlier_result() {
    let mut bench = Bench::new();
    let base = format!("medium: Homogeneous(6), {POINT}, resolution: 4, seed: 5, batches: 4");
    let whole = photons(&mut bench, &format!("{base}, photons: 3000"));
    let nodes = format!(
        r#""a": PhotonScatter({base}, photons: 1000), "b": PhotonScatter({base}, photons: 500, earlier: "a.tallies"),
        "c": PhotonScatter({base}, photons: 1500, earlier: "b.tallies"),"#
    );
    let parts = run(&mut bench, &nodes, "c");
    for port in ["fluence", "deposited", "absorbed", "escaped", "faces"] {
        assert_eq!(whole[port], parts[port], "{port}");
    }
    assert_eq!(parts["tallies"][..3], [3000.0, 12.0, 3000.0]);
    // The spread of twelve batches tells what that of four does.
    let sum = |v: &Values| v["error"].iter().sum::<f64>();
    assert!((0.6..1.7).contains(&(sum(&whole) / sum(&parts))), "{} {}", sum(&whole), sum(&parts));
}

/// Numbers that no medium has make it empty or dense, not endless.
#[test]
fn odd_densities_do_no_harm() {
    let mut bench = Bench::new();
    for (what, odd, absorbed) in [("NaN", f64::NAN, 0.0), ("below 0", -1e30, 0.0), ("infinity", f64::INFINITY, 1.0), ("huge", 1e30, 1.0)] {
        for tracking in ["March", "Delta"] {
            let text = format!(
                r#"Graph(version: 1, inputs: {{"odd": Volume}}, nodes: {{
                "p": PhotonScatter(medium: "odd", {POINT}, tracking: {tracking}, albedo: 0, resolution: 2, photons: 200)}}, outputs: {{"out": "p.absorbed"}})"#
            );
            let graph = compile(&text, &[("odd", EdgeType::volume([4, 4, 4], 1))]).unwrap_or_else(|e| panic!("{e}"));
            let input = |_: &str| Tensor::Volume(Block::from_fn([4, 4, 4], 1, |_, _, _| [odd; 4]));
            let v = bench.gpu(&graph, &input).unwrap_or_else(|e| panic!("{e}"));
            // Between infinities a device may find no number, which is an empty place.
            let found = v["out"][0];
            let expected = if found == 0.0 && what == "infinity" { 0.0 } else { absorbed };
            assert!((found - expected).abs() < 1e-6, "{what}, {tracking}: {found}");
        }
    }
}

#[test]
fn tallies_of_another_resolution_are_refused() {
    let text = r#"Graph(version: 1, inputs: {}, nodes: {"a": PhotonScatter(resolution: 3), "b": PhotonScatter(resolution: 4, earlier: "a.tallies")},
        outputs: {"out": "b"})"#;
    let message = compile(text, &[]).err().unwrap_or_default();
    assert!(message.contains("of the same resolution"), "{message}");
}

#[test]
fn unscattered_light_leaves_through_the_face_that_it_meets() {
    let mut bench = Bench::new();
    for (i, direction) in ["-1, 0, 0", "1, 0, 0", "0, -1, 0", "0, 1, 0", "0, 0, -1", "0, 0, 1"].iter().enumerate() {
        let v = photons(
            &mut bench,
            &format!(
                "medium: Homogeneous(0), light: Beam([0.3, 0.4, 0.7], [{direction}]), resolution: 2, photons: 100, estimator: TrackLength"
            ),
        );
        let expected: Vec<f64> = (0..6).map(|f| f64::from(u8::from(f == i))).collect();
        assert_eq!(v["faces"], expected);
    }
    // Missing the cube is leaving it, along the longest part of the direction.
    let v = photons(&mut bench, "medium: Homogeneous(1), light: Beam([2, 3, 4], [0.1, 0.9, 0.2]), resolution: 2, photons: 100");
    assert_eq!(v["faces"], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
}

/// Pearson's χ² of how often values fall between edges, less its mean, in standard deviations of χ².
fn surprise(values: &[f64], edges: &[f64], share: impl Fn(f64, f64) -> f64) -> f64 {
    let bins = edges.len() - 1;
    let mut counts = vec![0.0; bins];
    for v in values {
        counts[edges.partition_point(|e| e <= v).clamp(1, bins) - 1] += 1.0;
    }
    let expected = |i: usize| share(edges[i], edges[i + 1]) * values.len() as f64;
    let squared: f64 = (0..bins).map(|i| (counts[i] - expected(i)).powi(2) / expected(i)).sum();
    (squared - (bins - 1) as f64) / (2.0 * (bins - 1) as f64).sqrt()
}

#[test]
fn directions_are_distributed_as_the_phase_functions_say() {
    let mut bench = Bench::new();
    let n = 100_000;
    let even = |from: f64, to: f64, bins: i32| (0..=bins).map(|i| from + (to - from) * f64::from(i) / f64::from(bins)).collect::<Vec<_>>();
    let rayleigh = |mu: f64| (mu * mu * mu + 3.0 * mu + 4.0) / 8.0;
    let henyey = |g: f64, mu: f64| (1.0 - g * g) / (2.0 * g) * ((1.0 + g * g - 2.0 * g * mu).powf(-0.5) - 1.0 / (1.0 + g));
    for (phase, g) in [(0, 0.0), (1, 0.0), (2, 0.75), (2, -0.4), (2, 0.98), (2, 0.001)] {
        for direction in ["0, 0, 1", "0.6, -0.64, -0.48"] {
            let text = format!(
                r#"Graph(version: 1, inputs: {{}}, nodes: {{"s": Scattered(phase: {phase}, g: {g}, direction: ({direction}), count: {n})}}, outputs: {{"out": "s"}})"#
            );
            let graph = compile(&text, &[]).unwrap_or_else(|e| panic!("{e}"));
            let drawn = bench.gpu(&graph, &volume).unwrap_or_else(|e| panic!("{e}")).remove("out").unwrap_or_default();
            let cosines: Vec<f64> = drawn.iter().step_by(2).copied().collect();
            let turns: Vec<f64> = drawn.iter().skip(1).step_by(2).copied().collect();
            let below = |mu: f64| match phase {
                0 => 0.5 * mu + 0.5,
                1 => rayleigh(mu),
                _ => henyey(g, mu),
            };
            let what = format!("phase {phase}, g {g}, along {direction}");
            let mean = cosines.iter().sum::<f64>() / f64::from(n);
            agree(&what, mean, g, 1.0 / f64::from(n).sqrt(), 3.0);
            // Narrow bins where nearly all light goes.
            let edges = if g > 0.9 { even(0.9, 1.0, 40) } else { even(-1.0, 1.0, 40) };
            let inside: Vec<f64> = cosines.into_iter().filter(|mu| *mu >= edges[0]).collect();
            let all = below(1.0) - below(edges[0]);
            let odd = surprise(&inside, &edges, |a, b| (below(b) - below(a)) / all);
            assert!(odd < 4.0, "{what}: cosines are {odd:.1} deviations off");
            let odd = surprise(&turns, &even(0.0, 1.0, 36), |a, b| b - a);
            assert!(odd < 4.0, "{what}: turns are {odd:.1} deviations off");
        }
    }
}

#[test]
fn a_sum_that_overflows_does_not_look_right() {
    let mut bench = Bench::new();
    let text = r#"Graph(version: 1, inputs: {"before": Table}, nodes: {
        "p": PhotonScatter(medium: Homogeneous(5), light: Point([0.5, 0.5, 0.5]), resolution: 1, photons: 100, earlier: "before"),
    }, outputs: {"fluence": "p.fluence", "error": "p.error"})"#;
    let graph = compile(text, &[("before", EdgeType::table(25, Element::U32))]).unwrap_or_else(|e| panic!("{e}"));
    for (high, overflows) in [(0xffff_ffff_u32, true), (0x7fff_ffff, false)] {
        // Ten photons in one batch, and a fluence whose low word is about to be carried into the high one.
        let mut before = vec![0.0; 25];
        (before[0], before[1], before[2]) = (10.0, 1.0, 10.0);
        (before[20], before[21]) = (4_294_967_295.0, f64::from(high));
        let v = bench.gpu(&graph, &|_| Tensor::Table(before.clone())).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(v["fluence"][0].is_nan(), overflows);
        assert_eq!(v["error"][0].is_nan(), overflows);
    }
}
