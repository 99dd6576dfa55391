//! Images that do not fit are made tile by tile: the same pixels as whole, to the bit where nothing is summed up.

use pipe_graph::graph::Graph;
use pipe_graph::pass::{Limits, Profile};
use pipe_graph::reference::Tensor;
use pipe_graph::types::{EdgeType, ImageType};
use pipe_plan::{Options, Plan};
use pipe_tests::bench::{Bench, Values, compile, plan};
use pipe_tests::source::{edge, edge_type};

const SIZE: [u32; 2] = [61, 47];

fn graph(nodes: &str, outputs: &str) -> Graph {
    let text = format!(r#"Graph(version: 1, inputs: {{"in": Image, "grey": Image}}, nodes: {{{nodes}}}, outputs: {{{outputs}}})"#);
    let types = ["in", "grey"].map(|n| (n, edge_type(n, SIZE)));
    compile(&text, &types).unwrap_or_else(|e| panic!("{text}\n{e}"))
}

fn input(name: &str) -> Tensor {
    edge(name, SIZE)
}

fn tiled(graph: &Graph, limits: &Limits, tile: [u32; 2]) -> Plan {
    plan(graph, limits, &Options { tile: Some(tile), ..Options::default() }).unwrap_or_else(|e| panic!("{e}"))
}

/// Bits of every output, by name.
fn bits(values: &Values) -> Vec<(String, Vec<u64>)> {
    let mut all: Vec<_> = values.iter().map(|(n, v)| (n.clone(), v.iter().map(|x| x.to_bits()).collect())).collect();
    all.sort();
    all
}

/// Runs a graph whole and in tiles of several sizes.
fn same_in_tiles(nodes: &str, outputs: &str) {
    let graph = graph(nodes, outputs);
    let mut bench = Bench::new();
    for profile in [Profile::Gpu, Profile::Cpu] {
        let limits = Limits { profile, ..bench.limits() };
        // Whole, but of the passes that tiles want.
        let whole = plan(&graph, &Limits { tiled: true, ..limits }, &Options::default()).unwrap_or_else(|e| panic!("{e}"));
        let whole = bench.run(&graph, whole, &input).unwrap_or_else(|e| panic!("{e}"));
        for tile in [[16, 16], [61, 5], [7, 47], [19, 14], [64, 64]] {
            let plan = tiled(&graph, &limits, tile);
            assert!(plan.tilings().next().is_some(), "{nodes}: nothing is made in tiles\n{}", plan.to_text());
            let got = bench.run(&graph, plan, &input).unwrap_or_else(|e| panic!("{e}"));
            assert!(bits(&got) == bits(&whole), "{nodes}: tiles of {tile:?} differ, {profile:?} kernels");
        }
    }
}

#[test]
fn point_passes_in_tiles() {
    same_in_tiles(
        r#""a": Exposure(image: "in", ev: 1), "b": Mix(a: "a", b: "grey", factor: 0.3), "n": Noise(size: (61, 47)), "c": Math(a: "b", b: "n", op: Add)"#,
        r#""out": "c", "also": "a""#,
    );
}

#[test]
fn stencils_in_tiles_with_every_border() {
    for border in ["Clamp", "Mirror", "Black"] {
        same_in_tiles(
            &format!(
                r#""b": GaussianBlur(image: "in", sigma: 1.5, options: (border: {border})), "l": Laplacian(image: "b", options: (border: {border})),
                "m": Median(image: "l", radius: 1, options: (border: {border})), "x": BoxBlur(image: "m", radius: 3, options: (border: {border}))"#
            ),
            r#""out": "x", "blurred": "b""#,
        );
    }
}

#[test]
fn a_recursive_filter_in_tiles() {
    same_in_tiles(r#""b": GaussianBlur(image: "in", sigma: 4, method: Recursive)"#, r#""out": "b""#);
}

/// What wraps around is held whole; the rest is not.
#[test]
fn a_periodic_border_in_tiles() {
    same_in_tiles(
        r#""a": Exposure(image: "in", ev: 1), "b": GaussianBlur(image: "a", sigma: 1.5, options: (border: Repeat)), "c": Invert(image: "b")"#,
        r#""out": "c""#,
    );
}

#[test]
fn loops_in_tiles() {
    same_in_tiles(
        r#""w": HeatDiffusion(image: "grey", steps: 7), "i": Iterate(state: {"u": "in"}, body: {"s": BlurV(image: "u", sigma: 0.6), "t": Mix(a: "s", b: "in", factor: 0.2)}, next: {"u": "t"}, count: 4),
           "c": Mix(a: "i", b: "w", factor: 0.5)"#,
        r#""out": "c""#,
    );
    same_in_tiles(r#""b": Laplacian(image: "in", options: (repeat: 3))"#, r#""out": "b""#);
}

#[test]
fn statistics_in_tiles_then_what_they_drive() {
    same_in_tiles(
        r#""l": Luminance(image: "in"), "a": PyramidAverage(image: "l", mean: Geometric), "t": ToneMap(image: "in", average: "a")"#,
        r#""out": "t", "average": "a""#,
    );
    same_in_tiles(r#""e": Equalize(image: "in"), "h": Histogram(image: "e")"#, r#""out": "e", "h": "h.out""#);
    same_in_tiles(
        r#""b": GaussianBlur(image: "in", sigma: 1), "s": Stats(image: "b"), "n": Normalize(image: "b")"#,
        r#""out": "n", "min": "s.min", "mean": "s.mean", "stddev": "s.stddev", "median": "s.median""#,
    );
}

#[test]
fn summed_area_tables_in_tiles() {
    same_in_tiles(r#""s": Sat(image: "in"), "b": BoxFromSat(sat: "s", radius: 5)"#, r#""out": "b", "sat": "s""#);
}

#[test]
fn scopes_in_tiles() {
    same_in_tiles(
        r#""w": Waveform(image: "in"), "v": Vectorscope(image: "in"), "h": Histogram2d(image: "in")"#,
        r#""w": "w", "v": "v", "h": "h.counts""#,
    );
}

/// Windows lie elsewhere, in images of other sizes.
#[test]
fn crops_and_resizes_in_tiles() {
    same_in_tiles(
        r#""c": Crop(image: "in", x: 7, y: 5, width: 31, height: 40), "b": GaussianBlur(image: "c", sigma: 1), "p": Pad(image: "b", left: 3, top: 9, right: 12, fill: Mirror),
           "o": Offset(image: "p", x: -20, y: 11)"#,
        r#""out": "o", "cropped": "c""#,
    );
    for filter in ["Box", "Linear", "Lanczos3"] {
        same_in_tiles(
            &format!(
                r#""s": Resize(image: "in", width: 23, height: 31, filter: {filter}), "e": Exposure(image: "s", ev: 1), "l": Resize(image: "e", scale: 3.7, filter: {filter}),
                   "f": Resize(image: "in", width: 90, height: 40, fit: Letterbox, filter: {filter})"#
            ),
            r#""small": "s", "large": "l", "framed": "f""#,
        );
    }
    same_in_tiles(
        r#""half": Resize(image: "in", scale: 0.5), "back": Resize(image: "half", width: 61, height: 47), "d": Math(a: "in", b: "back", op: Sub), "s": Stats(image: "d"),
           "n": Math(a: "d", b: "grey", op: Max)"#,
        r#""out": "n", "most": "s.max""#,
    );
}

#[test]
fn flips_and_quarter_turns_in_tiles() {
    for direction in ["Horizontal", "Vertical", "Both"] {
        same_in_tiles(
            &format!(
                r#""b": BoxBlur(image: "in", radius: 2), "f": Flip(image: "b", direction: {direction}), "m": Mix(a: "f", b: "in", factor: 0.3)"#
            ),
            r#""out": "m""#,
        );
    }
    for turns in [-1, 1, 2] {
        same_in_tiles(
            &format!(
                r#""b": BoxBlur(image: "in", radius: 2), "t": Rotate90(image: "b", turns: {turns}), "l": Laplacian(image: "t"), "back": Rotate90(image: "l", turns: {turns}),
                   "c": Math(a: "back", b: "in", op: Add)"#
            ),
            r#""out": "l", "back": "c""#,
        );
    }
}

/// What somebody reads from anywhere is made in tiles and held whole.
#[test]
fn an_image_that_is_read_from_anywhere_is_held() {
    same_in_tiles(
        r#""b": GaussianBlur(image: "in", sigma: 1), "t": Transform(image: "b", rotate: 20), "c": Mix(a: "t", b: "b", factor: 0.4)"#,
        r#""out": "c""#,
    );
}

/// A budget decides: whole where it fits, tiles where it does not, and an error with the culprit where they cannot help.
#[test]
fn a_budget_decides() {
    let types = [("in", EdgeType::Image(ImageType::new([512, 512], 4)))];
    let blur = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {"b": GaussianBlur(image: "in", sigma: 2)}, outputs: {"out": "b"})"#;
    let blur = compile(blur, &types).unwrap_or_else(|e| panic!("{e}"));
    let with = |graph: &Graph, budget: u64| plan(graph, &Limits::default(), &Options { budget: Some(budget), ..Options::default() });
    assert_eq!(with(&blur, 64 << 20).unwrap_or_else(|e| panic!("{e}")).tilings().count(), 0);
    for budget in [8 << 20, 2 << 20, 1 << 19] {
        let plan = with(&blur, budget).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(plan.tilings().count(), 1);
        assert!(plan.peak_bytes <= budget, "{} of {budget}", plan.peak_bytes);
    }
    let message = with(&blur, 4 << 10).expect_err("nothing fits into 4 KiB");
    assert!(message.contains("tiles do not help"), "{message}");

    let turn = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {"a": Exposure(image: "in", ev: 1), "turned": Transform(image: "a", rotate: 30)}, outputs: {"out": "turned"})"#;
    let turn = compile(turn, &types).unwrap_or_else(|e| panic!("{e}"));
    let message = with(&turn, 1 << 20).expect_err("a rotated image is held whole");
    assert!(message.contains("needs 4.0 MiB whole, since `turned` reads it from anywhere"), "{message}");
}

/// The plan is the same however often it is made, and a wide image is cut along x where textures are narrow.
#[test]
fn images_wider_than_a_texture_are_cut_along_x() {
    let types = [("in", EdgeType::Image(ImageType::new([40000, 100], 4)))];
    let text = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {"b": GaussianBlur(image: "in", sigma: 2)}, outputs: {"out": "b"})"#;
    let graph = compile(text, &types).unwrap_or_else(|e| panic!("{e}"));
    let make = || plan(&graph, &Limits::default(), &Options::default()).unwrap_or_else(|e| panic!("{e}"));
    let text = make().to_text();
    assert_eq!(text, make().to_text());
    assert_eq!(make().tilings().map(pipe_plan::plan::Tiling::layout).collect::<Vec<_>>(), [[5, 1]], "{text}");
}
