//! Filters against values that others computed (`references/filters.py`), on kernels of both profiles, and against what is
//! known of a Gaussian.

use pipe_graph::graph::Graph;
use pipe_graph::pass::{Limits, Profile};
use pipe_graph::reference::{Raster, Tensor};
use pipe_graph::types::EdgeType;
use pipe_plan::Options;
use pipe_tests::bench::{Bench, compile, plan, reference};
use pipe_tests::source::hash;
use serde::Deserialize;

/// A table of expected values.
#[derive(Deserialize)]
struct References {
    size: [u32; 2],
    /// Where the values stand.
    pixels: Vec<[usize; 2]>,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    node: String,
    border: String,
    port: String,
    /// Allowed error, as a share of max(1, |value|).
    within: f64,
    values: Vec<f64>,
}

/// Fractions that floats hold exactly, on a ramp.
fn pattern([a, b, k, q]: [i64; 4], x: i64, y: i64) -> f64 {
    ((a * x + b * y + k * x * y + q * x * x) % 32) as f64 / 32.0 + (x + 2 * y) as f64 / 64.0
}

fn input(name: &str, size: [u32; 2]) -> Tensor {
    Tensor::Image(match name {
        "grey" => Raster::from_fn(size, 1, |x, y| {
            let dot = if (x, y) == (12, 10) { 6.0 } else { 0.0 };
            [pattern([7, 13, 5, 3], x, y) + dot; 4]
        }),
        _ => Raster::from_fn(size, 4, |x, y| {
            let alpha = if name == "opaque" { 1.0 } else { pattern([5, 5, 0, 0], x, y) / 4.0 };
            [pattern([3, 5, 1, 0], x, y), pattern([11, 2, 3, 1], x, y), pattern([1, 9, 7, 5], x, y), alpha]
        }),
    })
}

/// A graph of one node, with its options.
fn graph(node: &str, port: &str, border: &str, size: [u32; 2]) -> Graph {
    let names = ["grey", "colour", "opaque"].into_iter().filter(|n| node.contains(&format!("\"{n}\"")));
    let types: Vec<(&str, EdgeType)> = names.map(|n| (n, EdgeType::image(size, if n == "grey" { 1 } else { 4 }))).collect();
    let inputs: String = types.iter().map(|(n, _)| format!("\"{n}\": Image, ")).collect();
    let call = node.strip_suffix(')').expect("a node is a call");
    let text = format!(
        "Graph(version: 1, inputs: {{{inputs}}}, nodes: {{\"node\": {call}, options: (border: {border}))}}, outputs: {{\"out\": \"node.{port}\"}})"
    );
    compile(&text, &types).unwrap_or_else(|e| panic!("{e}"))
}

fn run(bench: &mut Bench, graph: &Graph, profile: Profile, inputs: &dyn Fn(&str) -> Tensor) -> Vec<f64> {
    let limits = Limits { profile, ..bench.limits() };
    let plan = plan(graph, &limits, &Options::default()).unwrap_or_else(|e| panic!("{e}"));
    bench.run(graph, plan, inputs).unwrap_or_else(|e| panic!("{e}")).remove("out").expect("it has this output")
}

/// The largest difference; infinite where one is not a number.
fn furthest(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, |most, d| if d.is_nan() { f64::INFINITY } else { most.max(d) })
}

#[test]
fn filters_agree_with_other_libraries() {
    let references: References =
        serde_json::from_str(include_str!("references/filters.json")).expect("filters.py writes what is read here");
    let mut bench = Bench::new();
    let mut wrong = Vec::new();
    for case in &references.cases {
        let graph = graph(&case.node, &case.port, &case.border, references.size);
        for profile in [Profile::Gpu, Profile::Cpu] {
            let got = run(&mut bench, &graph, profile, &|name| input(name, references.size));
            let channels = got.len() / (references.size[0] * references.size[1]) as usize;
            let picked = references
                .pixels
                .iter()
                .flat_map(|[x, y]| (0..channels).map(move |c| (y * references.size[0] as usize + x) * channels + c));
            let share = |i: usize, e: f64| (got[i] / e.abs().max(1.0), e / e.abs().max(1.0));
            let off = furthest(picked.zip(&case.values).map(|(i, e)| share(i, *e)));
            assert_eq!(references.pixels.len() * channels, case.values.len(), "{}", case.node);
            if off > case.within {
                wrong.push(format!(
                    "{} {} `{}` {profile:?}: off by {off:.2e}, allowed {:.0e}",
                    case.node, case.border, case.port, case.within
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), references.cases.len(), wrong.join("\n"));
}

/// Weights that are all different, so that no two taps can change places.
fn uneven(radius: usize) -> Vec<f64> {
    (0..=2 * radius).map(|i| f64::from((hash(3, i as u64) - 0.3) as f32)).collect()
}

#[test]
fn rows_staged_in_workgroup_memory_are_rows() {
    let mut bench = Bench::new();
    // Tiles of every height, and several of them with a rest along both axes.
    for (radius, size) in [(1, [130, 19]), (2, [64, 8]), (5, [61, 47]), (28, [70, 9]), (29, [300, 6]), (64, [260, 5]), (200, [530, 2])] {
        for border in ["Clamp", "Mirror", "Repeat", "Black"] {
            let graph = graph(&format!("BlurH(image: \"colour\", weights: {:?})", uneven(radius)), "out", border, size);
            let inputs = |name: &str| input(name, size);
            let expected = &reference(&graph, &inputs)["out"];
            let got = run(&mut bench, &graph, Profile::Gpu, &inputs);
            // The sum of the absolute weights times the largest value bounds the terms that are added up.
            let bound = 2e-6 * uneven(radius).iter().map(|w| w.abs()).sum::<f64>() * 15.0;
            let off = furthest(got.iter().copied().zip(expected.iter().copied()));
            assert!(off <= bound, "radius {radius} {border}: off by {off:.2e}, allowed {bound:.1e}");
        }
    }
}

#[test]
fn what_comes_before_a_staged_row_is_computed_while_it_is_loaded() {
    let mut bench = Bench::new();
    let size = [61, 47];
    let text = "Graph(version: 1, inputs: {\"colour\": Image}, nodes: {\"edges\": Laplacian(image: \"colour\"),
        \"bright\": Exposure(image: \"edges\", ev: 1.5),
        \"soft\": BlurH(image: \"bright\", sigma: 1, options: (border: Black))}, outputs: {\"out\": \"soft\"})";
    let graph = compile(text, &[("colour", EdgeType::image(size, 4))]).unwrap_or_else(|e| panic!("{e}"));
    let inputs = |name: &str| input(name, size);
    let limits = Limits { profile: Profile::Gpu, ..bench.limits() };
    let plan = plan(&graph, &limits, &Options::default()).unwrap_or_else(|e| panic!("{e}"));
    let together = "colour/exposure.wgsl + filters/blur_rows_staged.wgsl";
    assert!(plan.kernels.iter().any(|k| k.label == together), "{}", plan.to_text());
    let got = run(&mut bench, &graph, Profile::Gpu, &inputs);
    let off = furthest(got.into_iter().zip(reference(&graph, &inputs)["out"].iter().copied()));
    assert!(off <= 1e-5, "off by {off:.2e}");
}

#[test]
fn a_staged_row_spreads_infinity_no_further_than_its_radius() {
    let mut bench = Bench::new();
    let size = [100, 10];
    let graph = graph("BlurH(image: \"grey\", sigma: 2)", "out", "Clamp", size);
    for x in 40..48 {
        let image = Raster::from_fn(size, 1, |i, j| [if (i, j) == (x, 4) { f64::INFINITY } else { 1.0 }; 4]);
        let got = run(&mut bench, &graph, Profile::Gpu, &|_| Tensor::Image(image.clone()));
        let spoiled: Vec<i64> = (0..1000).filter(|i| !got[*i as usize].is_finite()).collect();
        assert_eq!(spoiled, (400 + x - 6..=400 + x + 6).collect::<Vec<_>>());
        assert!(spoiled.iter().all(|i| got[*i as usize] == f64::INFINITY));
    }
}

/// Images of range 0..1 that a filter of a wide response could get wrong: a dot, an edge, noise.
fn trials(size: [u32; 2]) -> [(&'static str, Raster); 3] {
    let [w, h] = size.map(i64::from);
    [
        ("impulse", Raster::from_fn(size, 1, |x, y| [f64::from(u8::from((x, y) == (w / 2, h / 2))); 4])),
        ("step", Raster::from_fn(size, 1, |x, y| [f64::from(u8::from(2 * x + y > w)); 4])),
        ("noise", Raster::from_fn(size, 1, |x, y| [(hash(11, (y * w + x) as u64) * 2.0).floor(); 4])),
    ]
}

#[test]
fn fast_gaussians_are_within_a_thousandth_of_the_range() {
    let mut bench = Bench::new();
    let size = [131, 37];
    for sigma in [0.3, 2.0, 3.9, 4.0, 7.3, 31.0, 100.0] {
        for border in ["Clamp", "Mirror", "Repeat", "Black"] {
            let methods = ["Recursive", "Pyramid"]
                .map(|m| (m, graph(&format!("GaussianBlur(image: \"grey\", sigma: {sigma}, method: {m})"), "out", border, size)));
            for (what, image) in trials(size) {
                let inputs = |_: &str| Tensor::Image(image.clone());
                let expected = &reference(&methods[0].1, &inputs)["out"];
                for (method, graph) in &methods {
                    let got = run(&mut bench, graph, Profile::Gpu, &inputs);
                    let off = furthest(got.iter().copied().zip(expected.iter().copied()));
                    assert!(off <= 1e-3, "{method}, σ {sigma}, {border}, {what}: off by {off:.2e}");
                }
            }
        }
    }
}

#[test]
fn importance_sampling_converges_to_the_gaussian() {
    let mut bench = Bench::new();
    let size = [64, 48];
    // Wide enough that linear sampling between pixels adds little blur of its own.
    let exact = graph("GaussianBlur(image: \"grey\", sigma: 6, method: Recursive)", "out", "Clamp", size);
    let (_, edge) = trials(size)[1].clone();
    let inputs = |_: &str| Tensor::Image(edge.clone());
    let expected = &reference(&exact, &inputs)["out"];
    let mut before = f64::INFINITY;
    for samples in [1, 5, 25, 125, 625] {
        let graph = graph(&format!("GaussianImportance(image: \"grey\", sigma: 6, samples: {samples})"), "out", "Clamp", size);
        let got = run(&mut bench, &graph, Profile::Cpu, &inputs);
        let off = furthest(got.iter().copied().zip(expected.iter().copied()));
        assert!(off < before / 2.0, "{samples} samples are off by {off:.2e}, fewer by {before:.2e}");
        before = off;
    }
    assert!(before < 2e-3, "{before:.2e}");
}

/// A NaN at (20, 20), a block of them from (5, 5) to (8, 8), and an infinity, on 1.
fn spoiled(size: [u32; 2]) -> Tensor {
    Tensor::Image(Raster::from_fn(size, 1, |x, y| match (x, y) {
        (20, 20) | (5..=8, 5..=8) => [f64::NAN; 4],
        (30, 10) => [f64::INFINITY; 4],
        _ => [1.0; 4],
    }))
}

#[test]
fn a_median_forgets_single_values_that_are_no_numbers() {
    let mut bench = Bench::new();
    let size = [40, 30];
    for radius in 1..=3 {
        let graph = graph(&format!("Median(image: \"grey\", radius: {radius})"), "out", "Clamp", size);
        let inputs = |_: &str| spoiled(size);
        let got = run(&mut bench, &graph, Profile::Cpu, &inputs);
        let expected = &reference(&graph, &inputs)["out"];
        assert!(got.iter().zip(expected).all(|(g, e)| g == e || g.is_nan() && e.is_nan()));
        let at = |x: usize, y: usize| got[y * 40 + x];
        assert_eq!([at(20, 20), at(21, 20), at(30, 10)], [1.0; 3]);
        assert_eq!(at(6, 6).is_nan(), radius < 3, "most of 9 and of 25 values are NaN there, 16 of 49 are not");
    }
}

#[test]
fn what_is_no_number_spreads_no_further_than_a_window() {
    let mut bench = Bench::new();
    let size = [90, 70];
    let inputs = |_: &str| spoiled(size);
    let both = [Profile::Gpu, Profile::Cpu];
    for (radius, profile) in [1, 2, 8, 16, 17, 33].into_iter().flat_map(|r| both.map(|p| (r, p))) {
        let graph = graph(&format!("BoxBlur(image: \"grey\", radius: {radius})"), "out", "Clamp", size);
        let got = run(&mut bench, &graph, profile, &inputs);
        let expected = &reference(&graph, &inputs)["out"];
        let same = |(g, e): (&f64, &f64)| (g - e).abs() < 1e-6 || g == e || g.is_nan() && e.is_nan();
        assert!(got.iter().zip(expected).all(same), "radius {radius}, {profile:?}");
    }
    // The recursive filter spoils what the convolution of the same σ does.
    for profile in both {
        let mut spoilt = |method: &str| {
            let graph = graph(&format!("GaussianBlur(image: \"grey\", sigma: 3.2, method: {method})"), "out", "Mirror", size);
            run(&mut bench, &graph, profile, &inputs).iter().map(|v| v.is_finite()).collect::<Vec<_>>()
        };
        assert!(spoilt("Recursive") == spoilt("Separable"), "{profile:?}");
    }
}

/// A pixel of 20,000 on a ramp: nothing of it is left where no window holds it.
#[test]
fn a_bright_pixel_leaves_nothing_behind() {
    let mut bench = Bench::new();
    let size = [81, 61];
    let inputs = |_: &str| {
        Tensor::Image(Raster::from_fn(size, 1, |x, y| {
            [if (x, y) == (40, 30) { 2e4 } else { 0.3 + 0.005 * x as f64 + 0.002 * y as f64 }; 4]
        }))
    };
    for (node, reach) in [
        ("BoxBlur(image: \"grey\", radius: 1)", 1),
        ("BoxBlur(image: \"grey\", radius: 20)", 20),
        ("Guided(image: \"grey\", radius: 8)", 16),
    ] {
        let graph = graph(node, "out", "Clamp", size);
        let expected = &reference(&graph, &inputs)["out"];
        for profile in [Profile::Gpu, Profile::Cpu] {
            let got = run(&mut bench, &graph, profile, &inputs);
            let beyond = |i: &usize| (i % 81).abs_diff(40) > reach || (i / 81).abs_diff(30) > reach;
            let off = furthest((0..got.len()).filter(beyond).map(|i| (got[i], expected[i])));
            assert!(off < 2e-5, "{node}, {profile:?}: off by {off:.2e}");
        }
    }
}

#[test]
fn a_nan_fills_a_morphological_element() {
    let mut bench = Bench::new();
    let size = [40, 30];
    for (shape, filled) in [("Square", 121), ("Disk", 81)] {
        for node in ["Dilate", "Erode"] {
            let graph = graph(&format!("{node}(image: \"grey\", radius: 5, shape: {shape})"), "out", "Mirror", size);
            let got = run(&mut bench, &graph, Profile::Gpu, &|_| spoiled(size));
            let near = |i: usize| (15..=25).contains(&(i % 40)) && (15..=25).contains(&(i / 40));
            assert_eq!(got.iter().enumerate().filter(|(i, v)| near(*i) && v.is_nan()).count(), filled, "{node} {shape}");
        }
    }
}

/// lavapipe ends an invocation without a word after 65,535 iterations over all its loops.
#[test]
fn the_longest_loops_come_to_their_end() {
    let mut bench = Bench::new();
    let size = [300, 300];
    let ones = |_: &str| Tensor::Image(Raster::from_fn(size, 1, |_, _| [1.0; 4]));
    for node in ["BlurH", "BlurV"] {
        // Of ones the result is the sum of the weights.
        let graph = graph(&format!("{node}(image: \"grey\", sigma: 1000)"), "out", "Clamp", size);
        for profile in [Profile::Gpu, Profile::Cpu] {
            let off = furthest(run(&mut bench, &graph, profile, &ones).into_iter().map(|v| (v, 1.0)));
            assert!(off < 3e-6, "{node} {profile:?}: off by {off:.2e}");
        }
    }
    // A dot grows to a disk, cut by the image.
    let dot = |_: &str| Tensor::Image(Raster::from_fn(size, 1, |x, y| [f64::from(u8::from((x, y) == (0, 299))); 4]));
    let graph = graph("Dilate(image: \"grey\", radius: 280, shape: Disk)", "out", "Black", size);
    let grown = run(&mut bench, &graph, Profile::Cpu, &dot).iter().filter(|v| **v == 1.0).count();
    let inside = (0..300_u64).flat_map(|y| (0..300_u64).map(move |x| x * x + y * y)).filter(|d| *d <= 280 * 280).count();
    assert_eq!(grown, inside);
}
