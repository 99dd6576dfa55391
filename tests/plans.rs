//! What must hold for every plan, on random graphs: fusing, sharing slots and scheduling change no result, and the order of a
//! file decides nothing.

use std::cell::RefCell;

use pipe_graph::graph::Graph;
use pipe_graph::pass::{Limits, Profile};
use pipe_graph::reference::{Raster, Tensor};
use pipe_graph::rim::{PixelForm, Sample, Transfer};
use pipe_graph::types::{EdgeType, ImageType};
use pipe_plan::lower::{Rim, lower};
use pipe_plan::{Options, Phase, Plan, plan_graph};
use pipe_tests::bench::{Bench, compile, plan, reference};
use pipe_tests::source::{edge, edge_type};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

/// Small, odd, and larger than a workgroup along one axis only.
const SIZE: [u32; 2] = [19, 7];

/// A node of a random graph: which kind, and how far back its inputs lie.
type Choice = (u8, usize, usize);

/// The text of node `i`, whose inputs are among the images before it.
fn node(i: usize, (kind, a, b): Choice) -> String {
    let image = |back: usize| match i.checked_sub(1 + back % (i + 2)) {
        Some(n) => format!("n{n}"),
        None => ["in", "other"][back % 2].to_owned(),
    };
    let (a, b) = (image(a), image(b));
    match kind % 14 {
        0 => format!(r#"Exposure(image: "{a}", ev: -0.5)"#),
        1 => format!(r#"Invert(image: "{a}")"#),
        2 => format!(r#"Saturation(image: "{a}", factor: 0.6)"#),
        3 | 4 => format!(r#"Mix(a: "{a}", b: "{b}", factor: 0.4)"#),
        5 => format!(r#"Math(a: "{a}", b: "{b}", op: Max)"#),
        6 => format!(r#"Luminance(image: "{a}")"#),
        7 => format!(r#"GaussianBlur(image: "{a}", sigma: 0.7, options: (border: Mirror))"#),
        8 => format!(r#"Laplacian(image: "{a}", options: (border: Black))"#),
        9 => format!(r#"Flip(image: "{a}")"#),
        10 => format!(r#"Clamp(image: "{a}", min: -2, max: 2)"#),
        11 => format!(r#"Normalize(image: "{a}", low: -3, high: 3, options: (repeat: 3))"#),
        12 => format!(r#"BoxBlur(image: "{a}", radius: 2)"#),
        _ => format!(
            r#"Iterate(state: {{"u": "in"}}, body: {{"s": Mix(a: "u", b: "{a}", factor: 0.2), "t": BlurH(image: "s", sigma: 0.6)}},
                next: {{"u": "t"}}, count: 3)"#
        ),
    }
}

/// A graph of these nodes; the last three are outputs, and the mean of the last is measured. Where the nodes do not begin with
/// the first, inputs and outputs stand in another order too.
fn text(choices: &[Choice], order: &[usize]) -> String {
    let nodes: Vec<String> = choices.iter().enumerate().map(|(i, c)| format!("\"n{i}\": {},\n", node(i, *c))).collect();
    let ordered: String = order.iter().filter_map(|i| nodes.get(*i)).cloned().collect();
    let n = choices.len();
    let mut outputs: Vec<String> = (n.saturating_sub(3)..n).map(|i| format!("\"o{i}\": \"n{i}\"")).collect();
    let mut inputs = [r#""in": Image"#, r#""other": Image"#];
    if order.first() != Some(&0) {
        inputs.reverse();
        outputs.reverse();
    }
    format!(
        r#"Graph(version: 1, inputs: {{{}}}, nodes: {{{ordered} "mean": PyramidAverage(image: "n{}")}},
        outputs: {{{}, "mean": "mean"}})"#,
        inputs.join(", "),
        n - 1,
        outputs.join(", ")
    )
}

fn graph(text: &str) -> Graph {
    let types = ["in", "other"].map(|n| (n, edge_type(n, SIZE)));
    compile(text, &types).unwrap_or_else(|e| panic!("{text}\n{e}"))
}

fn planned(graph: &Graph, limits: &Limits, fuse: bool) -> Plan {
    plan(graph, limits, &Options { fuse, ..Options::default() }).unwrap_or_else(|e| panic!("{e}"))
}

fn input(name: &str) -> Tensor {
    edge(name, SIZE)
}

fn config(cases: u32) -> Config {
    Config { cases, failure_persistence: None, ..Config::default() }
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn the_order_of_a_file_decides_nothing_and_fusing_only_saves(
        choices in prop::collection::vec((any::<u8>(), 0_usize..12, 0_usize..12), 2..60),
        seed in any::<u64>(),
    ) {
        let n = choices.len();
        let forwards: Vec<usize> = (0..n).collect();
        let mut shuffled = forwards.clone();
        shuffled.sort_by_key(|i| (*i as u64 + 1).wrapping_mul(seed | 1).rotate_left(17));
        let (one, other) = (graph(&text(&choices, &forwards)), graph(&text(&choices, &shuffled)));
        for profile in [Profile::Gpu, Profile::Cpu] {
            let limits = Limits { profile, ..Limits::default() };
            let fused = planned(&one, &limits, true);
            prop_assert_eq!(fused.to_text(), planned(&other, &limits, true).to_text());
            let plain = planned(&one, &limits, false);
            prop_assert!(fused.pass_count() <= plain.pass_count());
            prop_assert!(fused.peak_bytes <= fused.naive_bytes && plain.peak_bytes <= plain.naive_bytes);
        }
    }
}

/// A slot that held two live resources, a fused pass that read what is not there yet, a loop that ended in the wrong buffer:
/// each would show.
#[test]
fn every_plan_gives_what_the_graph_means() {
    let bench = RefCell::new(Bench::new());
    let graphs = prop::collection::vec((any::<u8>(), 0_usize..8, 0_usize..8), 2..24);
    let outcome = TestRunner::new(config(24)).run(&graphs, |choices| {
        let order: Vec<usize> = (0..choices.len()).collect();
        let text = text(&choices, &order);
        let graph = graph(&text);
        let expected = reference(&graph, &input);
        let mut bench = bench.borrow_mut();
        let limits = bench.limits();
        for fuse in [true, false] {
            let got = bench.run(&graph, planned(&graph, &limits, fuse), &input).map_err(TestCaseError::fail)?;
            for (name, expected) in &expected {
                for (i, (g, e)) in got[name].iter().zip(expected).enumerate() {
                    let close = (g - e).abs() <= 2e-4 * (1.0 + e.abs());
                    prop_assert!(close, "fuse: {fuse}: {name}[{i}] is {g}, expected {e}\n{text}");
                }
            }
        }
        Ok(())
    });
    outcome.unwrap_or_else(|e| panic!("{e}"));
}

/// Reductions of one image, of what is made of it pixel by pixel, and one that lies behind another.
const REDUCTIONS: &str = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {
        "lit": Exposure(image: "in", ev: 0.3),
        "luma": Luminance(image: "lit"),
        "stats": Stats(image: "lit"),
        "histogram": Histogram(image: "lit", range: (-1, 2)),
        "average": PyramidAverage(image: "lit"),
        "grey": PyramidAverage(image: "luma", mean: Geometric),
        "stretched": Normalize(image: "lit"),
    }, outputs: {"min": "stats.min", "max": "stats.max", "mean": "stats.mean", "stddev": "stats.stddev", "nan": "stats.nan_count",
        "inf": "stats.inf_count", "median": "stats.median", "counts": "histogram", "average": "average", "grey": "grey",
        "stretched": "stretched"})"#;

/// The same without percentiles, which need several walks by nature.
const ONE_WALK: &str = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {
        "stats": Stats(image: "in"), "histogram": Histogram(image: "in"), "average": PyramidAverage(image: "in"),
    }, outputs: {"min": "stats.min", "max": "stats.max", "mean": "stats.mean", "stddev": "stats.stddev", "nan": "stats.nan_count",
        "inf": "stats.inf_count", "counts": "histogram", "average": "average"})"#;

#[test]
fn reductions_of_one_image_read_it_once() {
    for size in [[1, 1], [61, 47], [4096, 4096], [10000, 10000]] {
        let graph = compile(ONE_WALK, &[("in", edge_type("in", size))]).unwrap_or_else(|e| panic!("{e}"));
        for profile in [Profile::Gpu, Profile::Cpu] {
            let limits = Limits { profile, ..Limits::default() };
            // Passes over the image, or over the words of its file.
            let readers = |fuse| {
                let plan = planned(&graph, &limits, fuse).to_json(&size);
                let passes = plan["passes"].as_array().cloned().unwrap_or_default();
                passes
                    .into_iter()
                    .filter(|p| {
                        p["reads"].as_array().is_some_and(|r| r.iter().any(|name| name.as_str().is_some_and(|n| n.starts_with("in"))))
                    })
                    .count()
            };
            assert_eq!(readers(true), 1, "{size:?} {profile:?}");
            // Decoding the file, and five reductions.
            assert_eq!(readers(false), 6, "{size:?} {profile:?}");
        }
    }
}

/// Three histograms of a CPU take 16 KiB each; the planner says so and leaves them apart.
#[test]
fn reductions_that_do_not_fit_together_stay_apart() {
    let channel = |c: &str| format!(r#""{c}": Histogram(image: "in", channel: {c})"#);
    let text = format!(
        r#"Graph(version: 1, inputs: {{"in": Image}}, nodes: {{{}, {}}}, outputs: {{"r": "R", "g": "G"}})"#,
        channel("R"),
        channel("G")
    );
    let graph = compile(&text, &[("in", edge_type("in", SIZE))]).unwrap_or_else(|e| panic!("{e}"));
    let told = |profile| {
        let limits = Limits { profile, ..Limits::default() };
        let passes = lower(&graph, &Rim::default(), &limits).unwrap_or_else(|e| panic!("{e}"));
        pipe_plan::after(passes, Phase::Fuse, true, &limits)
    };
    assert!(told(Profile::Gpu).contains("G.counts and R.counts share one read"));
    let apart = "G.counts and R.counts each read the same image: together they take more workgroup memory than devices have";
    assert!(told(Profile::Cpu).contains(apart), "{}", told(Profile::Cpu));
}

/// The order of a lane's pixels does not depend on company, so neither does any bit.
#[test]
fn reductions_that_share_a_walk_give_the_same_bits() {
    let mut bench = Bench::new();
    for text in [REDUCTIONS, ONE_WALK] {
        for size in [[61, 47], [257, 129], [1, 1]] {
            let graph = compile(text, &[("in", edge_type("in", size))]).unwrap_or_else(|e| panic!("{e}"));
            for profile in [Profile::Gpu, Profile::Cpu] {
                let limits = Limits { profile, ..bench.limits() };
                let [fused, alone] = [true, false].map(|fuse| {
                    let plan = planned(&graph, &limits, fuse);
                    bench.run(&graph, plan, &|name| edge(name, size)).unwrap_or_else(|e| panic!("{e}"))
                });
                for (name, values) in &fused {
                    let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(values), bits(&alone[name]), "{name} at {size:?}, {profile:?}");
                }
            }
        }
    }
}

/// Nodes whose parameters leave every value as it is.
const UNTOUCHED: [&str; 14] = [
    r#"Exposure(image: "a")"#,
    r#"Exposure(image: "a", ev: 0, options: (repeat: 3))"#,
    r#"Gamma(image: "a")"#,
    r#"Grade(image: "a")"#,
    r#"Shuffle(image: "a")"#,
    r#"Colorspace(image: "a", from: "srgb", to: "srgb")"#,
    r#"Offset(image: "a")"#,
    r#"Crop(image: "a")"#,
    r#"Pad(image: "a")"#,
    r#"BoxBlur(image: "a", radius: 0)"#,
    r#"BlurH(image: "a", sigma: 0)"#,
    r#"BlurV(image: "a", weights: [1])"#,
    r#"GaussianBlur(image: "a", sigma: 0)"#,
    r#"GaussianBlur(image: "a", sigma: (0, 0), method: Recursive)"#,
];

/// As it would be stored: NaN, infinities and negative values too.
#[test]
fn nodes_that_change_nothing_are_no_passes() {
    let mut bench = Bench::new();
    let special = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.5, 65504.0, 1e-3];
    let image = Raster::from_fn(SIZE, 4, |x, y| std::array::from_fn(|c| special[((x + 3 * y) as usize + c) % special.len()]));
    for node in UNTOUCHED {
        let with = |nodes: &str, last: &str| {
            let text = format!(r#"Graph(version: 1, inputs: {{"a": Image}}, nodes: {{{nodes}}}, outputs: {{"out": "{last}"}})"#);
            compile(&text, &[("a", edge_type("in", SIZE))]).unwrap_or_else(|e| panic!("{text}\n{e}"))
        };
        let iterated = format!(
            r#""n": Iterate(state: {{"u": "a"}}, body: {{"s": {}}}, next: {{"u": "s"}}, count: 3)"#,
            node.replace("\"a\"", "\"u\"")
        );
        for (nodes, passes) in [(format!(r#""n": {node}"#), Some(0)), (iterated, None)] {
            let graph = with(&nodes, "n");
            let plan = planned(&graph, &bench.limits(), false);
            if let Some(passes) = passes {
                // Decoding and encoding are left.
                assert_eq!(plan.pass_count(), passes + 2, "{nodes}\n{}", plan.to_text());
            }
            let got = bench.run(&graph, plan, &|_| Tensor::Image(image.clone())).unwrap_or_else(|e| panic!("{nodes}: {e}"));
            for (g, e) in got["out"].iter().zip(image.pixels.iter().flatten()) {
                assert!(g.to_bits() == (*e as f32 as f64).to_bits() || (g.is_nan() && e.is_nan()), "{nodes}: {g}, expected {e}");
            }
        }
    }
}

/// 500 nodes are planned in the time of a blink; the bound is generous, the figure stands in docs/performance.md.
#[test]
fn a_graph_of_500_nodes_is_planned() {
    let choices: Vec<Choice> = (0..500).map(|i| ((i * 7 % 11) as u8, i * 5 % 9, i * 3 % 7)).collect();
    let order: Vec<usize> = (0..choices.len()).collect();
    let graph = graph(&text(&choices, &order));
    let started = std::time::Instant::now();
    let plan = planned(&graph, &Limits::default(), true);
    println!("{} passes in {:.1} ms", plan.pass_count(), started.elapsed().as_secs_f64() * 1e3);
    assert!(plan.peak_bytes < plan.naive_bytes);
}

/// What a file of halves holds, and what only moves it or chooses among it, takes half of the memory and loses nothing; what is
/// computed takes all of its bits.
#[test]
fn halves_are_stored_as_halves() {
    let text = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {"f": Flip(image: "in"), "m": Median(image: "f", radius: 1),
        "turned": Rotate90(image: "m"), "b": GaussianBlur(image: "turned", sigma: 1)}, outputs: {"out": "b", "turned": "turned"})"#;
    let size = [40, 30];
    let graph = compile(text, &[("in", EdgeType::Image(ImageType::new(size, 4)))]).unwrap_or_else(|e| panic!("{e}"));
    let form = PixelForm { sample: Sample::F16, ..PixelForm::linear(size, 4) };
    let formats = |form: PixelForm| {
        let rim = Rim { inputs: [("in".to_owned(), form)].into_iter().collect(), ..Rim::default() };
        let plan = plan_graph(&graph, &rim, &Limits::default(), &Options { keep: true, ..Options::default() }, &|_| true);
        let plan = plan.unwrap_or_else(|e| panic!("{e}"));
        let count = |format: &str| plan.slots.iter().filter(|s| s.storage.format() == format).count();
        [count("rgba16float"), count("rgba32float")]
    };
    assert_eq!(formats(form), [4, 2]);
    // A curve, or other primaries, makes numbers that no half is.
    assert_eq!(formats(PixelForm { transfer: Transfer::Srgb, ..form }), [0, 6]);
    assert_eq!(formats(PixelForm::linear(size, 4)), [0, 6]);
}
