//! Folds: reductions of an image that share one walk over it.
//!
//! A workgroup takes a tile and leaves what it comes to; a lane takes every n-th pixel, row after row. The entry point made
//! here begins all folds, loads (or computes) each pixel once and hands it to each of them, and ends them one after the
//! other, so that they may use the same scratch. The order of a lane's pixels does not depend on which folds there are: a
//! fold gives the same bits alone and in company.
//!
//! Tiles stand at multiples of their size: group row g reads the rows from g times the tile's height on and no others.

use std::fmt::Write as _;

use pipe_graph::pass::{Entry, Grid, ResourceId, Walk};

use super::entry::stage_calls;
use super::layout;
use crate::kernel_pass::{KernelPass, Stage};

/// Where a lane is, and the scratch that its folds share.
pub(super) fn declare(io: &mut String, pass: &KernelPass) {
    let Some(scratch) = pass.folds().map(|w| w.scratch).max() else { return };
    io.push_str("var<private> lane: i32;\nvar<private> group: i32;\n");
    if scratch > 0 {
        let _ = writeln!(io, "var<workgroup> scratch: array<vec4f, {scratch}>;");
    }
}

/// `LANES`, `lane()`, `group()` and the scratch of a fold.
pub(super) fn place(text: &mut String, pass: &KernelPass, stage: &Stage) {
    let (Entry::Fold(workspace), Grid::Walk(walk)) = (stage.entry, pass.grid) else { return };
    let (store, load) = match workspace.scratch {
        // Where every lane leaves its own numbers, nothing is shared.
        0 => ("", "vec4f()"),
        _ => ("package::io::scratch[i] = v;", "package::io::scratch[i]"),
    };
    let _ = write!(
        text,
        "const LANES: i32 = {};\n\
         fn lane() -> i32 {{ return package::io::lane; }}\n\
         fn group() -> i32 {{ return package::io::group; }}\n\
         fn scratch_store(i: i32, v: vec4f) {{ {store} }}\n\
         fn scratch_load(i: i32) -> vec4f {{ return {load}; }}\n",
        walk.lane_count()
    );
}

/// Whether a fold's `take` may ask for more: its `settle` is called outside of the loop over pixels, for the rare ones that
/// take long.
fn settles(stage: &Stage) -> bool {
    matches!(stage.entry, Entry::Fold(_)) && stage.shader.source.contains("fn settle(")
}

/// Hands the pixel `at` to a fold.
pub(super) fn take(s: usize, stage: &Stage, v: &str) -> String {
    let call = format!("package::s{s}::take(at, {v})");
    if settles(stage) { format!("let d{s} = {call};") } else { format!("{call};") }
}

/// The entry point of the folds of a pass, over an image whose size this expression says; of a tile, from the
/// block on that its uniforms say.
pub(super) fn main_module(pass: &KernelPass, walk: Walk, size: &str, tiled: bool, index: &dyn Fn(ResourceId, bool) -> usize) -> String {
    let bind: String = layout::bind_calls(pass).iter().map(|call| format!("    {call}\n")).collect();
    let each = |function: &str, of: &dyn Fn(&Stage) -> bool| -> String {
        let folds = pass.stages.iter().enumerate().filter(|(_, s)| matches!(s.entry, Entry::Fold(_)) && of(s));
        folds.map(|(s, _)| format!("    package::s{s}::{function}();\n")).collect()
    };
    let doubts = pass.stages.iter().enumerate().filter(|(_, stage)| settles(stage)).map(|(s, _)| format!("d{s}"));
    let doubt = doubts.collect::<Vec<_>>().join(" | ");
    let (begin, end, settle) = (each("begin", &|_| true), each("end", &|_| true), each("settle", &settles));
    let ([lx, ly], [tx, ty]) = (walk.lanes, walk.tile);
    let offset = if tiled { "package::io::uniforms.grid_first + " } else { "" };
    let body = stage_calls(pass, index);
    let next = format!("at.x += {lx};\nif at.x >= last.x {{ at = vec2i(start.x, at.y + {ly}); }}\n");
    let pixels = if doubt.is_empty() {
        format!("    while at.y < last.y {{\n{body}{next}    }}\n")
    } else {
        let quick = format!("    while at.y < last.y {{\n{body}{next}if {doubt} {{ break; }}\n    }}\n");
        format!("    while at.y < last.y {{\n{quick}{settle}    }}\n")
    };
    format!(
        "@compute @workgroup_size({lx}, {ly}, 1)\n\
         fn main(\n    @builtin(workgroup_id) group: vec3u,\n    @builtin(local_invocation_id) local: vec3u,\n\
         \x20   @builtin(local_invocation_index) lane: u32,\n) {{\n{bind}\
         \x20   let size = {size};\n\
         \x20   let tile = {offset}vec2i(group.xy);\n\
         \x20   let first = tile * vec2i({tx}, {ty});\n\
         \x20   let last = min(first + vec2i({tx}, {ty}), size);\n\
         \x20   package::io::lane = i32(lane);\n\
         \x20   package::io::group = tile.y * ((size.x + {}) / {tx}) + tile.x;\n\
         {begin}\
         \x20   let start = first + vec2i(local.xy);\n\
         \x20   var at = vec2i(start.x, select(last.y, start.y, start.x < last.x));\n\
         {pixels}{end}}}\n",
        tx - 1,
    )
}
