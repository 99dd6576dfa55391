//! Statistics against NumPy (`references/analysis.py`), and sums of many pixels against sums in double precision.

use std::path::PathBuf;

use pipe_graph::pass::{Limits, Profile};
use pipe_graph::reference::{Raster, Tensor};
use pipe_graph::types::EdgeType;
use pipe_io::{ReadOptions, Source};
use pipe_plan::Options;
use pipe_tests::bench::{Bench, Values, compile, plan};
use pipe_tests::source::hash;
use serde::Deserialize;

#[derive(Deserialize)]
struct References {
    histograms: Vec<Counts>,
    statistics: Vec<Statistics>,
    /// x, y and the sum over everything above and to the left of it.
    sums: Vec<(usize, usize, f64)>,
    equalized: String,
}

#[derive(Deserialize)]
struct Counts {
    image: String,
    bins: u32,
    range: [f64; 2],
    outside: String,
    total: u64,
    head: Vec<u64>,
    fnv: String,
}

#[derive(Deserialize)]
struct Statistics {
    image: String,
    min: f64,
    max: f64,
    mean: f64,
    stddev: f64,
    median: f64,
    p01: f64,
    p99: f64,
    nan_count: f64,
    inf_count: f64,
    geometric: f64,
}

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn references() -> References {
    let text = std::fs::read_to_string(path("references/analysis.json")).expect("the table is there");
    serde_json::from_str(&text).expect("it is JSON")
}

/// The images that `analysis.py` makes.
fn image(name: &str) -> Raster {
    let size = [257, 129];
    match name {
        "noise" => {
            let mut state = 1_u32;
            let mut i = 0;
            Raster::from_fn(size, 1, |_, _| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let at = i;
                i += 1;
                let v = f64::from((state >> 8) as f32 / 8_388_608.0 - 0.5);
                let (nan, inf) = (at % 97 == 0, f64::INFINITY);
                let v = if nan { f64::NAN } else { v };
                let v = if at >= 5 && (at - 5) % 101 == 0 { inf } else { v };
                let v = if at >= 7 && (at - 7) % 103 == 0 { -inf } else { v };
                [v; 4]
            })
        }
        "constant" => Raster::from_fn(size, 1, |_, _| [0.25; 4]),
        _ => {
            let file = path("data/workshop.exr").display().to_string();
            let picture = pipe_io::read(&Source::parse(&file), &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
            Raster::from_fn([picture.width, picture.height], 1, |x, y| {
                [f64::from(picture.sample_at(x as u32, y as u32, 1).expect("inside")); 4]
            })
        }
    }
}

fn run(bench: &mut Bench, image: &Raster, nodes: &str, outputs: &str) -> Values {
    let text = format!(r#"Graph(version: 1, inputs: {{"in": Image}}, nodes: {{{nodes}}}, outputs: {{{outputs}}})"#);
    let graph = compile(&text, &[("in", EdgeType::image(image.size, image.channels))]).unwrap_or_else(|e| panic!("{e}"));
    bench.gpu(&graph, &|_| Tensor::Image(image.clone())).unwrap_or_else(|e| panic!("{e}"))
}

fn fnv(values: impl Iterator<Item = u64>) -> String {
    let h = values.fold(0xCBF2_9CE4_8422_2325_u64, |h, v| (h ^ v).wrapping_mul(0x100_0000_01B3));
    format!("{h:016x}")
}

#[test]
fn histograms_are_those_of_numpy_to_the_last_pixel_by_both_methods() {
    let mut bench = Bench::new();
    let table = references().histograms;
    for c in &table {
        let [low, high] = c.range;
        let node = |method: &str| {
            format!(
                r#"Histogram(image: "in", bins: {}, range: ({low:?}, {high:?}), channel: R, method: {method}, outside: {})"#,
                c.bins, c.outside
            )
        };
        let nodes = format!(r#""a": {}, "b": {}"#, node("Atomic"), node("Blend"));
        let got = run(&mut bench, &image(&c.image), &nodes, r#""a": "a", "b": "b""#);
        for method in ["a", "b"] {
            let counts: Vec<u64> = got[method].iter().map(|v| *v as u64).collect();
            let what = format!("{} in {} bins over {low}..{high}, outside {}, method {method}", c.image, c.bins, c.outside);
            assert_eq!(counts[..c.head.len()], c.head, "{what}");
            assert_eq!(counts.iter().sum::<u64>(), c.total, "{what}");
            assert_eq!(fnv(counts.into_iter()), c.fnv, "{what}");
        }
    }
    assert!(table.len() >= 40);
}

#[test]
fn statistics_are_those_of_numpy() {
    let mut bench = Bench::new();
    for s in references().statistics {
        let names = ["min", "max", "mean", "stddev", "median", "p01", "p99", "nan_count", "inf_count"];
        let outputs: String = names.iter().map(|n| format!(r#""{n}": "s.{n}", "#)).collect();
        let nodes = r#""s": Stats(image: "in"), "g": PyramidAverage(image: "in", mean: Geometric),
                       "t": SatAverage(image: "in", mean: Geometric)"#;
        let got = run(&mut bench, &image(&s.image), nodes, &format!(r#"{outputs} "g": "g", "t": "t""#));
        let expected = [s.min, s.max, s.mean, s.stddev, s.median, s.p01, s.p99, s.nan_count, s.inf_count];
        let pairs = names.iter().zip(expected).chain([(&"g", s.geometric), (&"t", s.geometric)]);
        for (name, expected) in pairs {
            let value = got[*name][0];
            assert!((value - expected).abs() <= 1e-5 * expected.abs().max(1e-3), "{} of {}: {value}, expected {expected}", name, s.image);
        }
    }
}

/// Sums of squares would leave nothing of these: values far from zero and close together, and one far from all others that
/// comes first.
#[test]
fn deviations_are_right_far_from_zero() {
    type Value<'a> = &'a dyn Fn(i64, i64) -> f64;
    let mut bench = Bench::new();
    let wave = |x: i64, y: i64| 2.0 * hash(1, (4096 * y + x) as u64) - 1.0;
    let images: [(&str, f64, Value<'_>); 5] = [
        ("1e4 ± 1", 2e-7, &|x, y| 1e4 + wave(x, y)),
        ("-1e6 ± 10", 2e-7, &|x, y| -1e6 + 10.0 * wave(x, y)),
        ("1e-3 ± 1e-6", 2e-7, &|x, y| 1e-3 + 1e-6 * wave(x, y)),
        ("a bright pixel first", 4e-6, &|x, y| if x + y == 0 { 1e4 } else { wave(x, y) }),
        ("a constant", 2e-7, &|_, _| 12_345.678),
    ];
    for (what, tolerance, value) in images {
        for size in [[1, 1], [61, 47], [1031, 517]] {
            let image = Raster::from_fn(size, 1, |x, y| [f64::from(value(x, y) as f32); 4]);
            let values: Vec<f64> = image.pixels.iter().map(|p| p[0]).collect();
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let expected = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
            let text =
                r#"Graph(version: 1, inputs: {"in": Image}, nodes: {"s": Stats(image: "in")}, outputs: {"s": "s.stddev", "m": "s.mean"})"#;
            let graph = compile(text, &[("in", EdgeType::image(size, 1))]).unwrap_or_else(|e| panic!("{e}"));
            for profile in [Profile::Gpu, Profile::Cpu] {
                let plan = plan(&graph, &Limits { profile, ..bench.limits() }, &Options::default()).unwrap_or_else(|e| panic!("{e}"));
                let got = bench.run(&graph, plan, &|_| Tensor::Image(image.clone())).unwrap_or_else(|e| panic!("{e}"));
                let (deviation, m) = (got["s"][0], got["m"][0]);
                assert!(
                    (deviation - expected).abs() <= tolerance * expected,
                    "{what} at {size:?}, {profile:?}: {deviation}, expected {expected}"
                );
                assert!((m - mean).abs() <= 1e-7 * mean.abs() + 1e-9, "{what} at {size:?}, {profile:?}: the mean is {m}, not {mean}");
            }
        }
    }
}

#[test]
fn the_summed_area_table_and_equalisation_are_those_of_numpy() {
    let mut bench = Bench::new();
    let natural = image("natural");
    let references = references();
    let nodes = r#""fast": Sat(image: "in"), "slow": Sat(image: "in", radix: 4), "e": Equalize(image: "in")"#;
    let got = run(&mut bench, &natural, nodes, r#""fast": "fast", "slow": "slow", "e": "e""#);
    for (x, y, expected) in references.sums {
        for name in ["fast", "slow"] {
            let channels = got[name].len() / (natural.size[0] * natural.size[1]) as usize;
            let value = got[name][(y * natural.size[0] as usize + x) * channels];
            assert!((value / expected - 1.0).abs() <= 1e-5, "{name} at {x}, {y}: {value}, expected {expected}");
        }
    }
    assert_eq!(fnv(got["e"].iter().map(|h| (h * 255.0).round() as u64)), references.equalized);
}

/// 67 million pixels: a plain sum in 32 bits would be off by a hundred times the bound.
#[test]
fn a_summed_area_table_of_8192_by_8192_is_within_1e_5() {
    const SIDE: usize = 8192;
    let mut bench = Bench::new();
    let size = [SIDE as u32; 2];
    let tile: Vec<f64> = (0..4096).map(|i| f64::from(hash(11, i) as f32)).collect();
    let value = |x: usize, y: usize| tile[(x * 31 + y * 17 + (x / 64) * (y / 32)) % 4096];
    // One output pixel in 512 along each axis, so that little is read back.
    let text = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {"sat": Sat(image: "in"),
        "few": Expr(a: "sat", red: "a.r"), "last": Crop(image: "few", x: 8128, y: 8128, width: 64, height: 64),
        "first": Crop(image: "few", x: 4096, y: 511, width: 64, height: 64)}, outputs: {"last": "last", "first": "first"})"#;
    let graph = compile(text, &[("in", EdgeType::image(size, 1))]).unwrap_or_else(|e| panic!("{e}"));
    let input = Raster::from_fn(size, 1, |x, y| [value(x as usize, y as usize); 4]);
    let got = bench.gpu(&graph, &|_| Tensor::Image(input.clone())).unwrap_or_else(|e| panic!("{e}"));
    let mut columns = vec![0.0_f64; SIDE];
    for y in 0..SIDE {
        let mut row = 0.0;
        for x in 0..SIDE {
            row += value(x, y);
            columns[x] += row;
        }
        for (name, x0, y0) in [("last", 8128, 8128), ("first", 4096, 511)] {
            if (y0..y0 + 64).contains(&y) {
                let channels = got[name].len() / 4096;
                for x in 0..64 {
                    let (value, expected) = (got[name][((y - y0) * 64 + x) * channels], columns[x0 + x]);
                    assert!((value / expected - 1.0).abs() <= 1e-5, "at {}, {y}: {value}, expected {expected}", x0 + x);
                }
            }
        }
    }
}
