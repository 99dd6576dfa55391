//! The free tests of every node: each of its examples, on the GPU against its twin in double precision, at awkward
//! sizes and with every border, and once with the kernels for the other kind of machine.
//!
//! `cargo test -p pipe-tests --test nodes -- Blur` runs those whose name contains `Blur`.

use std::collections::HashMap;
use std::ops::Range;

use pipe_graph::node::{Category, Kind};
use pipe_graph::pass::{Item, Limits, Origin, PassGraph, Profile, Reach, ResourceId, Shape, Value};
use pipe_graph::reference::{Raster, Tensor};
use pipe_graph::types::EdgeType;
use pipe_plan::Options;
use pipe_plan::lower::{Rim, lower};
use pipe_tests::bench::{Bench, Values, compile, plan, reference};
use pipe_tests::source::{edge, edge_type};

const SIZES: [[u32; 2]; 5] = [[61, 47], [1, 1], [1, 33], [70, 1], [257, 129]];
const BORDERS: [&str; 4] = ["Clamp", "Mirror", "Repeat", "Black"];
const EDGES: [&str; 8] = ["in", "other", "grey", "pair", "table", "curve", "volume", "fog"];

fn main() {
    let filter: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let mut bench = Bench::new();
    let (mut passed, mut failed) = (0, Vec::new());
    // What shapes the graph and becomes no pass is tested by `structure.rs`.
    for kind in pipe_nodes::REGISTRY.iter().filter(|k| k.category != Category::Structure || !k.ports.is_empty() || k.name == "Readback") {
        for (number, example) in kind.examples.iter().enumerate() {
            let name = format!("{}::example_{number}", kind.name);
            if !filter.is_empty() && !filter.iter().any(|f| name.contains(f.as_str())) {
                continue;
            }
            match every_variant(&mut bench, kind, example) {
                Ok(()) => {
                    passed += 1;
                    println!("test {name} ... ok");
                }
                Err(message) => {
                    println!("test {name} ... FAILED\n    {example}\n    {}", message.replace('\n', "\n    "));
                    failed.push(name);
                }
            }
        }
    }
    println!(
        "\ntest result: {}. {passed} passed; {} failed; 0 ignored; 0 measured; 0 filtered out",
        if failed.is_empty() { "ok" } else { "FAILED" },
        failed.len()
    );
    if !failed.is_empty() {
        std::process::exit(101);
    }
}

/// The option that stores results as half floats: 11 bits, to nearest or cut off as the device likes, up to 65504.
const HALF: &str = "format: F16";

/// The graph of one example: `{options}` is put behind its fields.
fn graph_text(kind: &Kind, example: &str, options: &str, ports: &[String]) -> String {
    let inputs: String = named(example)
        .map(|n| {
            let ty = match edge_type(n, [1, 1]) {
                EdgeType::Table(_) => "Table",
                EdgeType::Volume(_) => "Volume",
                _ => "Image",
            };
            format!("\"{n}\": {ty}, ")
        })
        .collect();
    let scalar = if example.contains("\"scalar\"") { "\"scalar\": ScalarSource()," } else { "" };
    let end = example.rfind(')').expect("an example is a call");
    let comma = if example[..end].trim_end().ends_with('(') { "" } else { ", " };
    let call = format!("{}{comma}options: ({options})){}", &example[..end], &example[end + 1..]);
    let outputs: String = ports.iter().map(|p| format!("\"{p}\": \"node.{p}\", ")).collect();
    let _ = kind;
    format!("Graph(version: 1, inputs: {{{inputs}}}, nodes: {{{scalar} \"node\": {call}}}, outputs: {{{outputs}}})")
}

/// The test inputs that an example names, as edges or in expressions.
fn named(example: &str) -> impl Iterator<Item = &'static str> + '_ {
    EDGES.into_iter().filter(|n| example.contains(&format!("\"{n}\"")) || example.contains(&format!("={n}.")))
}

fn every_variant(bench: &mut Bench, kind: &Kind, example: &str) -> Result<(), String> {
    let limits = bench.limits();
    for size in SIZES {
        one(bench, &limits, kind, example, size, "")?;
    }
    // Options of pixels mean nothing to a node that makes none.
    let makes_pixels = kind.category != Category::Structure;
    for border in BORDERS.into_iter().filter(|_| makes_pixels) {
        one(bench, &limits, kind, example, [61, 47], &format!("border: {border}"))?;
    }
    if makes_pixels {
        one(bench, &limits, kind, example, SIZES[4], HALF)?;
    }
    // Kernels for the other kind of machine are right on this one too.
    let profile = if limits.profile == Profile::Gpu { Profile::Cpu } else { Profile::Gpu };
    one(bench, &Limits { profile, ..limits }, kind, example, SIZES[4], "")?;
    in_tiles(bench, kind, example)?;
    reach_is_true(bench, kind, example)
}

/// Made tile by tile, whatever of it can be, the outputs are those of the same passes over whole images, to the bit: a
/// reach that were not true would show at the seams.
fn in_tiles(bench: &mut Bench, kind: &Kind, example: &str) -> Result<(), String> {
    let size = [61, 47];
    let types: Vec<(&str, EdgeType)> = named(example).map(|n| (n, edge_type(n, size))).collect();
    let ports: Vec<String> = kind.ports.iter().map(|p| p.0.to_owned()).collect();
    let graph = compile(&graph_text(kind, example, "", &ports), &types)?;
    let limits = Limits { tiled: true, ..bench.limits() };
    let tile = Some([19, 14]);
    let parts = plan(&graph, &limits, &Options { tile, ..Options::default() })?;
    if parts.tilings().next().is_none() {
        return Ok(());
    }
    let input = |name: &str| edge(name, size);
    let whole = plan(&graph, &limits, &Options::default())?;
    let (whole, parts) = (bench.run(&graph, whole, &input)?, bench.run(&graph, parts, &input)?);
    for port in &ports {
        let (Some(whole), Some(parts)) = (whole.get(port), parts.get(port)) else { continue };
        let differs = whole.iter().zip(parts).position(|(a, b)| a.to_bits() != b.to_bits());
        if let Some(i) = differs {
            return Err(format!("`{port}`[{i}] is {} whole and {} in tiles of {tile:?}", whole[i], parts[i]));
        }
    }
    Ok(())
}

/// Pixels of the inputs that the pixel in the middle of an output does not look at, by what the passes declare, are
/// changed: it must stay, to the bit.
fn reach_is_true(bench: &mut Bench, kind: &Kind, example: &str) -> Result<(), String> {
    let size = [61, 47];
    let types: Vec<(&str, EdgeType)> = named(example).map(|n| (n, edge_type(n, size))).collect();
    let ports: Vec<String> = kind.ports.iter().map(|p| p.0.to_owned()).collect();
    let graph = compile(&graph_text(kind, example, "", &ports), &types)?;
    let passes = lower(&graph, &Rim::default(), &bench.limits()).map_err(|e| e.to_string())?;
    let same = |name: &str| edge(name, size);
    let mut before: Option<Values> = None;
    for (name, value) in graph.outputs() {
        let EdgeType::Image(t) = graph.ty(value) else { continue };
        let middle = t.size.map(|n| i64::from(n / 2));
        let Some(looked_at) = looked_at(&passes, name, middle) else { continue };
        let changed = |name: &str| match (edge(name, size), looked_at.get(name)) {
            (Tensor::Image(r), Some(area)) => {
                let seen = |at: [i64; 2]| (0..2).all(|i| area[i].contains(&at[i]));
                let pixel = |x, y| if seen([x, y]) { r.at(x, y) } else { [0.875, 3.5, -0.25, 0.5] };
                Tensor::Image(Raster::from_fn(r.size, r.channels, pixel))
            }
            (other, _) => other,
        };
        let a = match before.take() {
            Some(a) => a,
            None => bench.gpu(&graph, &same)?,
        };
        let b = bench.gpu(&graph, &changed)?;
        let at = (middle[1] as usize * t.size[0] as usize + middle[0] as usize) * t.channels as usize;
        let [was, is] = [&a, &b].map(|v| v[name][at..at + t.channels as usize].to_vec());
        if was != is {
            return Err(format!(
                "`{name}` looks at {looked_at:?} for {middle:?}, by its declared reach, but a pixel elsewhere changes it: {was:?} and {is:?}"
            ));
        }
        before = Some(a);
    }
    Ok(())
}

/// The columns and rows of each input that a pixel of an output looks at, by what the passes declare; `None` when that is
/// anywhere, or beyond an edge of something.
fn looked_at(passes: &PassGraph, output: &str, pixel: [i64; 2]) -> Option<HashMap<String, Area>> {
    let fetched = passes.fetches.iter().find(|f| f.name == output)?;
    let one = || pixel.map(|n| n..n + 1);
    let mut areas: HashMap<ResourceId, Area> = fetched.parts.iter().map(|(id, _)| (*id, one())).collect();
    for item in passes.items.iter().rev() {
        let Item::Pass(pass) = item else { return None };
        let made = pass.writes.iter().filter_map(|w| areas.get(&w.resource).cloned()).reduce(|a, b| hull(&a, &b));
        let Some(made) = made else { continue };
        if pass.params.values().any(|value| matches!(value, Value::Driven(_))) {
            return None;
        }
        for read in &pass.reads {
            let resource = passes.resource(read.resource);
            if matches!(resource.origin, Origin::Literal(_)) {
                continue;
            }
            let area = match read.reach {
                // Words of a file are looked at pixel by pixel.
                _ if matches!(resource.shape, Shape::Words { .. } | Shape::Pixels { .. }) => made.clone(),
                Reach::Point => made.clone(),
                Reach::Around(x, y) => [(0, x), (1, y)].map(|(i, n)| made[i].start - i64::from(n)..made[i].end + i64::from(n)),
                Reach::Elsewhere(looks) => looks.map(|look| {
                    let ends = [made[look.along].start, made[look.along].end - 1].map(|i| look.first_of(i as u32));
                    ends[0].min(ends[1])..ends[0].max(ends[1]) + i64::from(look.count)
                }),
                Reach::Whole => return None,
            };
            let size = resource.shape.plane().unwrap_or([u32::MAX; 2]);
            if (0..2).any(|i| area[i].start < 0 || area[i].end > i64::from(size[i])) {
                return None;
            }
            let known = areas.get(&read.resource).cloned().unwrap_or_else(|| area.clone());
            areas.insert(read.resource, hull(&known, &area));
        }
    }
    let inputs = areas.into_iter().filter_map(|(id, area)| match &passes.resource(id).origin {
        Origin::External { name, .. } => Some((name.clone(), area)),
        _ => None,
    });
    Some(inputs.collect())
}

/// Columns and rows.
type Area = [Range<i64>; 2];

fn hull(a: &Area, b: &Area) -> Area {
    [0, 1].map(|i: usize| a[i].start.min(b[i].start)..a[i].end.max(b[i].end))
}

fn one(bench: &mut Bench, limits: &Limits, kind: &Kind, example: &str, size: [u32; 2], options: &str) -> Result<(), String> {
    let types: Vec<(&str, EdgeType)> = named(example).map(|n| (n, edge_type(n, size))).collect();
    let ports: Vec<String> = kind.ports.iter().map(|p| p.0.to_owned()).collect();
    let text = graph_text(kind, example, options, &ports);
    let graph = compile(&text, &types).map_err(|e| format!("{text}\n{e}"))?;
    let input = |name: &str| edge(name, size);
    let plan = plan(&graph, limits, &Options::default())?;
    let got = bench.run(&graph, plan, &input)?;
    let expected = reference(&graph, &input);
    for port in &ports {
        let (Some(got), Some(expected)) = (got.get(port), expected.get(port)) else {
            return Err(format!("port `{port}` is missing at {size:?}"));
        };
        if got.len() != expected.len() {
            return Err(format!("port `{port}` has {} values, expected {} at {size:?}", got.len(), expected.len()));
        }
        let mut strays = (kind.tolerance.strays * got.len() as f64) as usize;
        for (i, (g, e)) in got.iter().zip(expected).enumerate() {
            // Nodes of several passes round in between, too, and some enlarge what that loses.
            let rounding = if options == HALF { (1.0 + e.abs()) / 256.0 } else { 0.0 };
            let bound = kind.tolerance.absolute + kind.tolerance.relative * e.abs() + rounding;
            let too_large = options == HALF && e.abs() > 65504.0;
            let fits = too_large || (g - e).abs() <= bound || (g.is_nan() && e.is_nan()) || g == e;
            if !fits && strays > 0 {
                strays -= 1;
            } else if !fits {
                return Err(format!(
                    "`{port}`[{i}] is {g}, expected {e} (off by {:.3e}, allowed {bound:.3e}) at {size:?} {options}, {:?} kernels",
                    (g - e).abs(),
                    limits.profile
                ));
            }
        }
    }
    Ok(())
}
