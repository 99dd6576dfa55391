//! What must hold for every plan, on thousands of random graphs over all kinds of edges, without a GPU: `graphs` makes them,
//! `meaning` says what a graph means, `machine` runs a plan, `tiles` follows the pixels of every tile.

mod graphs;
mod machine;
mod meaning;
mod tiles;

use std::collections::BTreeSet;

use pipe_graph::pass::{Limits, PassGraph, Profile};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestError, TestRunner};

use crate::fuse::{Thrift, fuse};
use crate::kernel_pass::Ops;
use crate::prune::prune;
use crate::schedule::{Schedule, schedule};
use crate::{Options, Phase, after, allocate, tile};
use graphs::Choice;
use meaning::{Ending, Meaning};

/// Most are small, which finds most; some have 200 nodes.
fn recipes() -> impl Strategy<Value = Vec<Choice>> {
    let of = |range| prop::collection::vec(any::<Choice>(), range);
    prop_oneof![50 => of(1..12), 40 => of(12..40), 3 => of(100..201)]
}

fn check(cases: u32, test: impl Fn(Vec<Choice>) -> Result<(), String>) {
    let config = Config { cases, failure_persistence: None, max_shrink_time: 20_000, ..Config::default() };
    let outcome = TestRunner::new(config).run(&recipes(), |recipe| test(recipe).map_err(TestCaseError::fail));
    println!("{cases} cases");
    match outcome {
        Ok(()) => {}
        Err(TestError::Fail(why, recipe)) => {
            let graph = graphs::graph(&recipe);
            panic!("{why}\n{}{:#?}\n{recipe:?}", after(graph.clone(), Phase::Lower, false, &limits(&recipe)), graph.items)
        }
        Err(TestError::Abort(why)) => panic!("{why}"),
    }
}

fn limits(recipe: &[Choice]) -> Limits {
    let profile = if recipe.len().is_multiple_of(2) { Profile::Gpu } else { Profile::Cpu };
    Limits { profile, half_storage: !recipe.len().is_multiple_of(3), ..Limits::default() }
}

/// All ways to a schedule, named.
fn schedules(graph: PassGraph, limits: &Limits) -> [(&'static str, Schedule); 3] {
    let pruned = prune(Ops::new(graph));
    let fused = |thrift| schedule(fuse(pruned.clone(), limits, thrift).0);
    [("unfused", schedule(pruned.clone())), ("fused", fused(Thrift::Bytes)), ("fused for memory", fused(Thrift::Memory))]
}

/// Pruning, fusing and scheduling change nothing that the host takes.
#[test]
fn phases_keep_what_a_graph_means() {
    check(10_000, |recipe| {
        let graph = graphs::graph(&recipe);
        let ops = Ops::new(graph.clone());
        let wanted: BTreeSet<_> = ops.wanted().collect();
        let before = Meaning::of(&ops, &ops.ops, Ending::Latest).numbers;
        for (how, schedule) in schedules(graph, &limits(&recipe)) {
            let list: Vec<_> = schedule.portions.iter().flat_map(|p| p.ops().iter().cloned()).collect();
            let after = Meaning::of(&schedule.ops, &list, Ending::Latest).numbers;
            for id in &wanted {
                if before[id] != after[id] {
                    return Err(format!("{how}: {} is another", ops.resources[id.index()].name));
                }
            }
        }
        Ok(())
    });
}

/// No slot holds two live values: with slots shared and without, the host takes what the graph means.
#[test]
fn slots_hold_what_a_graph_means() {
    check(10_000, |recipe| {
        let graph = graphs::graph(&recipe);
        let ops = Ops::new(graph.clone());
        let limits = limits(&recipe);
        let expected = [Ending::Latest, Ending::FirstCheck].map(|ending| (ending, machine::expected(&ops, ending)));
        for (how, schedule) in schedules(graph, &limits).into_iter().take(2) {
            for keep in [false, true] {
                let options = Options { keep, budget: Some(u64::MAX), ..Options::default() };
                let plan = allocate::allocate("random", schedule.clone(), &limits, &options).map_err(|e| e.to_string())?;
                for (ending, expected) in &expected {
                    let seen = machine::play(&plan, &schedule, *ending).map_err(|e| format!("{how}, keep {keep}: {e}"))?;
                    let unlike = seen.unlike(expected);
                    if !unlike.is_empty() {
                        return Err(format!("{how}, keep {keep}, {ending:?}: other values of {unlike:?}\n{}", plan.to_text()));
                    }
                }
            }
        }
        Ok(())
    });
}

/// Tiles make what whole images are: every pixel of valid pixels alone, every block of a reduction once, in slots that hold
/// what the graph means.
#[test]
fn tiles_hold_what_a_graph_means() {
    check(4_000, |recipe| {
        let graph = graphs::graph(&recipe);
        let ops = Ops::new(graph.clone());
        let limits = limits(&recipe);
        let expected = machine::expected(&ops, Ending::Latest);
        let details = recipe.iter().fold(0_u64, |all, (_, details)| all.rotate_left(5) ^ details);
        let step = [5 + details % 48, 3 + details / 64 % 30].map(|n| n as u32);
        for (how, schedule) in schedules(graph, &limits) {
            let schedule = tile::cut_in(schedule, step);
            let in_tiles = |why: String| format!("{how}, in tiles of {step:?}: {why}");
            tiles::check(&schedule).map_err(in_tiles)?;
            let plan = allocate::allocate("random", schedule.clone(), &limits, &Options::default()).map_err(|e| e.to_string())?;
            let unlike = machine::play(&plan, &schedule, Ending::Latest).map_err(in_tiles)?.unlike(&expected);
            if !unlike.is_empty() {
                return Err(in_tiles(format!("other values of {unlike:?}\n{}", plan.to_text())));
            }
        }
        Ok(())
    });
}

/// How long planning takes: `cargo test --release -p pipe-plan -- --ignored --nocapture planning`.
#[test]
#[ignore = "measures, and can only pass"]
fn planning_500_passes() {
    let recipe: Vec<Choice> =
        (0..500_u64).map(|i| (if i % 9 == 8 { 24 } else { (i * 7 % 20) as u8 }, i.wrapping_mul(0x9e37_79b9_7f4a_7c15))).collect();
    let graph = graphs::graph(&recipe);
    let mut times: Vec<f64> = (0..7)
        .map(|_| {
            let (graph, started) = (graph.clone(), std::time::Instant::now());
            let ops = prune(Ops::new(graph));
            let schedule = schedule(fuse(ops, &Limits::default(), Thrift::Bytes).0);
            allocate::allocate("random", schedule, &Limits::default(), &Options::default()).unwrap_or_else(|e| panic!("{e}"));
            started.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("{:.1} ms, at worst {:.1}", times[3], times[6]);
}
