//! The energy of a wave: a sum over the whole grid, as a scalar that stays on the GPU.
//!
//! Each thread walks 64 rows of one column, so that neighbours read neighbours on a GPU and rows stay in cache on a
//! CPU; then sums of sums, until one thread can add the rest. The order is fixed: the same bits every time.

use pipe_graph::prelude::*;

use super::wave::{Boundary, Medium};
use crate::shader;

/// Entries that one thread adds.
const CHUNK: u32 = 64;

/// Declares the passes that leave the energy of a state in `out`.
pub(super) fn lower(cx: &mut Lowering<'_>, medium: &Medium, state: ResourceId, out: ResourceId) {
    let [w, h] = cx.image_of(state).size;
    let mut len = w * h.div_ceil(64);
    let mut terms = cx.intermediate("energy_columns", Shape::floats(len));
    cx.pass("energy_columns", shader!("simulation/wave_energy"))
        .read_with("state", state, Reach::Whole, medium.boundary.border(), Filter::Nearest)
        .write("out", terms)
        .constant("FIXED", medium.boundary == Boundary::Dirichlet)
        .param("c2", medium.c2)
        .param("area", medium.dx * medium.dx)
        .add();
    let sum = shader!("simulation/table_sum");
    let ending = |text: &str| Shader::builtin(&sum.path, &format!("{}\n{text}\n", sum.source));
    while len > CHUNK {
        len = len.div_ceil(CHUNK);
        let sums = cx.intermediate("energy_sums", Shape::floats(len));
        cx.pass("energy_sums", ending("fn at(i: i32) -> f32 { return strided_sum(i); }"))
            .read("terms", terms, Reach::Whole)
            .write("out", sums)
            .param("stride", len as i32)
            .add();
        terms = sums;
    }
    cx.pass("energy", ending("fn at(i: i32) -> vec4f { return vec4f(strided_sum(0)); }"))
        .read("terms", terms, Reach::Whole)
        .write("out", out)
        .param("stride", 1_i32)
        .add();
}
