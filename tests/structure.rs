//! What shapes a graph: iteration, repetition, feedback, bypass; and what the planner may change without changing results.

use pipe_graph::graph::Graph;
use pipe_graph::reference::Tensor;
use pipe_graph::types::EdgeType;
use pipe_plan::Options;
use pipe_tests::bench::{Bench, Values, compile, compile_with, plan, reference};
use pipe_tests::source::{edge, edge_type};

const SIZE: [u32; 2] = [61, 47];

fn input(name: &str) -> Tensor {
    edge(name, SIZE)
}

fn graph(nodes: &str, output: &str) -> Graph {
    let text = format!(r#"Graph(version: 1, inputs: {{"in": Image, "other": Image}}, nodes: {{{nodes}}}, outputs: {{"out": "{output}"}})"#);
    let types: [(&str, EdgeType); 2] = ["in", "other"].map(|n| (n, edge_type(n, SIZE)));
    compile(&text, &types).unwrap_or_else(|e| panic!("{e}"))
}

fn close(got: &Values, expected: &Values, tolerance: f64, what: &str) {
    let (got, expected) = (&got["out"], &expected["out"]);
    assert_eq!(got.len(), expected.len(), "{what}");
    for (i, (g, e)) in got.iter().zip(expected).enumerate() {
        assert!((g - e).abs() <= tolerance * (1.0 + e.abs()), "{what}: value {i} is {g}, expected {e}");
    }
}

/// Runs a graph fused and plain, against its twin.
fn both_ways(bench: &mut Bench, nodes: &str, output: &str) {
    let graph = graph(nodes, output);
    let expected = reference(&graph, &input);
    for fuse in [true, false] {
        let plan = plan(&graph, &bench.limits(), &Options { fuse, ..Options::default() }).unwrap_or_else(|e| panic!("{e}"));
        let got = bench.run(&graph, plan, &input).unwrap_or_else(|e| panic!("{e}"));
        close(&got, &expected, 2e-5, &format!("fuse: {fuse}, {nodes}"));
    }
}

#[test]
fn iteration_of_every_small_count() {
    let mut bench = Bench::new();
    for count in 0..=5 {
        both_ways(
            &mut bench,
            &format!(
                r#""it": Iterate(state: {{"u": "in"}}, body: {{"step": Convolve(image: "u"), "mixed": Mix(a: "step", b: "other", factor: 0.1)}},
                next: {{"u": "mixed"}}, count: {count})"#
            ),
            "it.u",
        );
    }
}

#[test]
fn the_initial_state_may_be_read_after_the_loop() {
    both_ways(
        &mut Bench::new(),
        r#""it": Iterate(state: {"u": "in"}, body: {"step": Invert(image: "u")}, next: {"u": "step"}, count: 3),
        "sum": Math(a: "it.u", b: "in", op: Add)"#,
        "sum",
    );
}

#[test]
fn states_may_swap_and_stay() {
    for count in 1..=4 {
        both_ways(
            &mut Bench::new(),
            &format!(
                r#""it": Iterate(state: {{"a": "in", "b": "other", "c": "in"}},
                body: {{"sum": Mix(a: "a", b: "c", factor: 0.25)}},
                next: {{"a": "b", "b": "sum", "c": "c"}}, count: {count}),
                "out": Math(a: "it.a", b: "it.b", op: Sub)"#
            ),
            "out",
        );
    }
}

#[test]
fn iterations_nest() {
    both_ways(
        &mut Bench::new(),
        r#""outer": Iterate(state: {"u": "in"}, body: {
            "inner": Iterate(state: {"v": "u"}, body: {"soft": BlurH(image: "v", sigma: 0.7)}, next: {"v": "soft"}, count: 3),
            "mixed": Mix(a: "inner.v", b: "other", factor: 0.2),
        }, next: {"u": "mixed"}, count: 4)"#,
        "outer.u",
    );
}

#[test]
fn until_stops_at_the_right_step() {
    // Halving from a maximum of 1: below 1e-2 after 7 steps; checked every 1, 2, 3 steps, so it runs 7, 8, 9 of them.
    for (every, ran) in [(1, 7), (2, 8), (3, 9)] {
        let graph = graph(
            &format!(
                r#""one": Constant(color: (1, 1, 1, 1), size: (16, 16)),
                "it": Iterate(state: {{"u": "one"}}, body: {{"half": Exposure(image: "u", ev: -1), "stats": Stats(image: "half")}},
                next: {{"u": "half"}}, until: Below(value: "stats.max", limit: 1e-2, every: {every}), max: 50)"#
            ),
            "it.u",
        );
        let got = Bench::new().gpu(&graph, &input).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(got["out"][0], 0.5_f64.powi(ran), "every {every}");
    }
}

#[test]
fn repeat_feeds_a_node_back_into_itself() {
    for n in [1, 2, 3, 8] {
        both_ways(&mut Bench::new(), &format!(r#""soft": BlurV(image: "in", sigma: 1, options: (repeat: {n}, border: Mirror))"#), "soft");
    }
}

#[test]
fn a_bypassed_node_passes_its_input_through() {
    let graph = graph(r#""soft": BlurV(image: "in", options: (when: false)), "negative": Invert(image: "soft")"#, "negative");
    let got = Bench::new().gpu(&graph, &input).unwrap_or_else(|e| panic!("{e}"));
    close(&got, &reference(&graph, &input), 1e-6, "bypass");
}

/// A graph with a flag and a number as parameters, some of it set from outside.
fn with_parameters(nodes: &str, output: &str, settings: &[(&str, &str)]) -> Result<Graph, String> {
    let text = format!(
        r#"Graph(version: 1, params: {{"flag": Bool(default: false), "k": F32(default: 2)}}, inputs: {{"in": Image, "other": Image}},
        nodes: {{{nodes}}}, outputs: {{"out": "{output}"}})"#
    );
    let types: [(&str, EdgeType); 2] = ["in", "other"].map(|n| (n, edge_type(n, SIZE)));
    compile_with(&text, &types, settings)
}

/// Two graphs make the same.
fn alike(bench: &mut Bench, graph: &Graph, plain: &Graph, what: &str) {
    let got = bench.gpu(graph, &input).unwrap_or_else(|e| panic!("{what}: {e}"));
    let expected = bench.gpu(plain, &input).unwrap_or_else(|e| panic!("{what}: {e}"));
    close(&got, &expected, 1e-6, what);
}

#[test]
fn flags_of_a_subgraph_are_set() {
    let mut bench = Bench::new();
    let on = graph(r#""a": Exposure(image: "in", ev: 1), "b": Offset(image: "a", x: 3)"#, "b");
    let off = graph(r#""b": Offset(image: "in", x: 3, wrap: false)"#, "b");
    for (value, plain) in
        [("true", &on), ("false", &off), ("\"=k > 1\"", &on), ("\"=k < 1\"", &off), ("\"=flag\"", &off), ("\"=!flag\"", &on)]
    {
        let nodes = format!(r#""s": Subgraph(file: "diagnostics/parts/flag.ron", inputs: {{"x": "in"}}, params: {{"on": {value}}})"#);
        let given = with_parameters(&nodes, "s", &[]).unwrap_or_else(|e| panic!("{value}: {e}"));
        alike(&mut bench, &given, plain, value);
    }
    let nodes = r#""s": Subgraph(file: "diagnostics/parts/flag.ron", inputs: {"x": "in"})"#;
    for name in ["s.on", "s/on", "s.params.on"] {
        let set = with_parameters(nodes, "s", &[(name, "false")]).unwrap_or_else(|e| panic!("{name}: {e}"));
        alike(&mut bench, &set, &off, name);
    }
}

#[test]
fn what_shapes_a_graph_is_bypassed_like_a_node() {
    let mut bench = Bench::new();
    let plain = graph(r#""a": Switch(inputs: ["in"])"#, "a");
    let other = graph(r#""a": Switch(inputs: ["other"])"#, "a");
    let both = r#"Subgraph(file: "diagnostics/parts/both.ron", inputs: {"other": "other", "base": "in"}, options: (when: false))"#;
    let swap = r#"Iterate(state: {"a": "in", "b": "other"}, body: {"m": Mix(a: "a", b: "b")}, next: {"a": "m", "b": "a"}, count: 3,
        options: (when: "=1 > 2"))"#;
    for (node, port, passed) in [
        (both, "", &plain),
        (both, ".grey", &plain),
        (swap, ".a", &plain),
        (swap, ".b", &other),
        (r#"Switch(index: 1, inputs: ["in", "other"], options: (when: false))"#, "", &plain),
        (r#"Feedback(init: "in", next: "n", options: (when: false))"#, "", &plain),
    ] {
        let bypassed = graph(&format!(r#""n": {node}"#), &format!("n{port}"));
        assert!(bypassed.iter().all(|(_, i)| i.kind == "Input"), "{node} leaves something behind");
        alike(&mut bench, &bypassed, passed, node);
    }
}

#[test]
fn a_subgraph_repeats_like_a_node() {
    let mut bench = Bench::new();
    let part = |base: &str, options: &str| {
        format!(r#"Subgraph(file: "diagnostics/parts/both.ron", inputs: {{"other": "other", "base": "{base}"}}{options})"#)
    };
    let chain = format!(r#""a": {}, "b": {}, "c": {}"#, part("in", ""), part("a", ""), part("b", ""));
    for (times, last) in [(1, "a"), (2, "b"), (3, "c")] {
        let nodes = format!(r#""n": {}"#, part("in", &format!(", options: (repeat: {times})")));
        both_ways(&mut bench, &nodes, "n");
        alike(&mut bench, &graph(&nodes, "n"), &graph(&chain, last), &nodes);
    }
}

#[test]
fn what_a_subgraph_makes_is_read_back() {
    let part = |options: &str| {
        format!(r#""n": Subgraph(file: "diagnostics/parts/both.ron", inputs: {{"other": "other", "base": "in"}}, options: ({options}))"#)
    };
    let fetched = |options: &str| {
        let graph = graph(&part(options), "n.out");
        let plan = plan(&graph, &pipe_graph::pass::Limits::default(), &Options::default()).unwrap_or_else(|e| panic!("{e}"));
        plan.to_text().contains("n:readback")
    };
    assert!(fetched(r#"readback: "first.npy""#), "as it stands");
    assert!(fetched(r#"readback: "first.npy", repeat: 2"#), "repeated");
    assert!(!fetched(r#"readback: "first.npy", when: false"#), "bypassed");
}

#[test]
fn parameters_of_a_shader_and_options_are_set() {
    let mut bench = Bench::new();
    let nodes = r#""w": Wgsl(shader: "diagnostics/parts/gain.wgsl", inputs: {"image": "in"}, outputs: {"out": Image(like: "image")},
        params: {"gain": F32(default: 2), "shift": I32(default: 0)}, access: Point)"#;
    let gain = graph(r#""a": Math(a: "in", b: 3, op: Mul)"#, "a");
    for name in ["w.gain", "w.params.gain", "w.params.gain.default"] {
        let set = with_parameters(nodes, "w", &[(name, "3")]).unwrap_or_else(|e| panic!("{name}: {e}"));
        alike(&mut bench, &set, &gain, name);
    }
    let plain = graph(r#""a": Switch(inputs: ["in"])"#, "a");
    let off = with_parameters(nodes, "w", &[("w.options.when", "false")]).unwrap_or_else(|e| panic!("{e}"));
    alike(&mut bench, &off, &plain, "w.options.when");
    let mistake = |name: &str, value: &str| with_parameters(nodes, "w", &[(name, value)]).expect_err(name);
    assert!(mistake("w.params.gian", "3").contains("--set w.params.gian: `w` has no `params.gian`"));
    assert!(mistake("w.shift", "0.5").contains("0.5 is no whole number"));
    assert!(mistake("w.gian", "3").contains("unknown field `gian`"));
}

#[test]
fn states_of_simulations_loop_from_an_image_of_four_channels() {
    let mut bench = Bench::new();
    for (port, node) in [
        ("state", "WaveEquation(state: \"s\", steps: 3, dt: 0.2, dx: 1, c2: 1"),
        ("state", "WaveEquation(state: \"s\", steps: 2, dt: 0.2, dx: 1, c2: 1, integrator: Verlet"),
        ("state", "WaveStep(state: \"s\", dt: 0.2, dx: 1, c2: 1"),
        ("image", "ReactionDiffusion(image: \"s\", steps: 3, dt: 0.01"),
    ] {
        both_ways(
            &mut bench,
            &format!(r#""it": Iterate(state: {{"s": "in"}}, body: {{"w": {node})}}, next: {{"s": "w"}}, count: 2)"#),
            "it.s",
        );
        let outside = node.replace(&format!("{port}: \"s\""), &format!("{port}: \"in\""));
        both_ways(&mut bench, &format!(r#""w": {outside}, options: (repeat: 2))"#), "w");
        // Six steps are six steps, wherever the state leaves between them.
        if node.contains("steps: 3") {
            let mut run = |nodes: &str| bench.gpu(&graph(nodes, "w"), &input).unwrap_or_else(|e| panic!("{e}"));
            let (once, twice) = (outside.replace("steps: 3", "steps: 6"), format!(r#""w": {outside}, options: (repeat: 2))"#));
            close(&run(&twice), &run(&format!(r#""w": {once})"#)), 1e-6, node);
        }
        both_ways(&mut bench, &format!(r#""s": Feedback(init: "in", next: "w"), "w": {node})"#), "w");
    }
}

#[test]
fn fused_is_unfused() {
    let mut bench = Bench::new();
    // A chain, a diamond, a tree, a stencil behind points, points behind a stencil, a driven parameter.
    for (nodes, output) in [
        (
            r#""a": Exposure(image: "in", ev: 1), "b": Saturation(image: "a", factor: 0.5), "c": Gamma(image: "b", gamma: 1.3), "d": Invert(image: "c")"#,
            "d",
        ),
        (
            r#""a": Exposure(image: "in", ev: 1), "b": Invert(image: "a"), "c": Saturation(image: "a", factor: 0), "d": Math(a: "b", b: "c", op: Mul)"#,
            "d",
        ),
        (
            r#""a": Invert(image: "in"), "b": Exposure(image: "other", ev: -1), "c": Mix(a: "a", b: "b", factor: 0.3), "d": Clamp(image: "c")"#,
            "d",
        ),
        (r#""a": Luminance(image: "in"), "b": Sobel(image: "a", options: (border: Black)), "c": Invert(image: "b")"#, "c"),
        (
            r#""a": Exposure(image: "in", ev: 2), "b": GaussianBlur(image: "a", sigma: 2, options: (border: Repeat)), "c": Math(a: "b", b: "a", op: Sub)"#,
            "c",
        ),
        (
            r#""y": Luminance(image: "in"), "m": PyramidAverage(image: "y", mean: Arithmetic), "t": ToneMap(image: "in", average: "m"), "i": Invert(image: "t")"#,
            "i",
        ),
    ] {
        both_ways(&mut bench, nodes, output);
    }
}

#[test]
fn a_chain_of_eight_point_nodes_is_one_pass() {
    let nodes: String = (0..8)
        .map(|i| format!(r#""n{i}": Exposure(image: "{}", ev: 0.1),"#, if i == 0 { "in".to_owned() } else { format!("n{}", i - 1) }))
        .collect();
    let graph = graph(&nodes, "n7");
    let plan = plan(&graph, &pipe_graph::pass::Limits::default(), &Options::default()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(plan.pass_count(), 1, "{}", plan.to_text());
}

#[test]
fn the_order_in_the_file_decides_nothing() {
    let a = graph(r#""a": Invert(image: "in"), "b": Exposure(image: "other", ev: 1), "c": Mix(a: "a", b: "b")"#, "c");
    let b = graph(r#""c": Mix(a: "a", b: "b"), "b": Exposure(image: "other", ev: 1), "a": Invert(image: "in")"#, "c");
    let text = |g: &Graph| plan(g, &pipe_graph::pass::Limits::default(), &Options::default()).unwrap_or_else(|e| panic!("{e}")).to_text();
    assert_eq!(text(&a), text(&b));
}

#[test]
fn the_same_input_gives_the_same_bits() {
    let mut bench = Bench::new();
    let graph = graph(r#""t": ToneMap(image: "in"), "e": Equalize(image: "t"), "b": GaussianBlur(image: "e")"#, "b");
    let first = bench.gpu(&graph, &input).unwrap_or_else(|e| panic!("{e}"));
    for _ in 0..3 {
        assert_eq!(bench.gpu(&graph, &input).unwrap_or_else(|e| panic!("{e}")), first);
    }
}
