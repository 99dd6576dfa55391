//! Reductions of the same image share one walk over it.

use std::collections::BTreeSet;

use pipe_graph::pass::{Grid, ResourceId, Shape};

use super::{Fusion, MOST_STAGES, join, within_limits};
use crate::kernel_pass::{KernelPass, Op, Source};

/// Most reductions that share a walk, each with some 16 registers of its own.
const MOST_FOLDS: usize = 8;

/// Workgroup memory that every device of WebGPU has, in bytes.
const WORKGROUP_BYTES: u32 = 16384;

impl Fusion<'_> {
    /// Puts reduction `a` into the walk of a later one over the same image.
    pub(super) fn join_folds(&mut self, a: usize) -> bool {
        for b in a + 1..self.list.len() {
            let (Some(first), Some(second)) = (self.pass(a), self.pass(b)) else { continue };
            if !same_walk(first, second) {
                continue;
            }
            let names = format!("{} and {}", first.name, second.name);
            let behind = self.behind(a, b);
            match self.may_share(first, second, behind.contains(&b)) {
                Ok(joined) => {
                    self.note(format!("{names} share one read"));
                    self.put_between(a, b, joined, &behind);
                    return true;
                }
                Err(why) => self.note(format!("{names} each read the same image: {why}")),
            }
        }
        false
    }

    fn may_share(&self, first: &KernelPass, second: &KernelPass, depends: bool) -> Result<KernelPass, &'static str> {
        if depends {
            return Err("the second needs what the first leads to");
        }
        let joined = join(first, second);
        if joined.stages.len() > MOST_STAGES || joined.folds().count() > MOST_FOLDS {
            return Err("the kernel would be too long");
        }
        if workgroup_bytes(&joined) > WORKGROUP_BYTES {
            return Err("together they take more workgroup memory than devices have");
        }
        if !within_limits(&joined, self.ops, self.limits) {
            return Err("together they bind more than the device allows");
        }
        Ok(joined)
    }

    /// Which operations behind `a`, up to `b`, must stay behind it.
    fn behind(&self, a: usize, b: usize) -> BTreeSet<usize> {
        let mut behind = BTreeSet::new();
        for i in a + 1..=b {
            if self.list[i].comes_behind(&self.list[a]) || behind.iter().any(|j: &usize| self.list[i].comes_behind(&self.list[*j])) {
                behind.insert(i);
            }
        }
        behind
    }

    /// Puts one pass in the place of `a` and `b`: behind what stands between them, before what needs `a`.
    fn put_between(&mut self, a: usize, b: usize, pass: KernelPass, behind: &BTreeSet<usize>) {
        let between: Vec<(usize, Op)> = (a..).zip(self.list.splice(a..=b, [])).filter(|(i, _)| *i != a && *i != b).collect();
        let (after, before): (Vec<_>, Vec<_>) = between.into_iter().partition(|(i, _)| behind.contains(i));
        let ops = |list: Vec<(usize, Op)>| list.into_iter().map(|(_, op)| op);
        self.list.splice(a..a, ops(before).chain([Op::Pass(pass)]).chain(ops(after)));
    }
}

/// Whether a pass is a reduction of an image, or several that share its walk.
pub(super) fn is_fold(pass: &KernelPass) -> bool {
    matches!(pass.grid, Grid::Walk(_))
}

/// Whether two passes are reductions that walk the same image in the same way.
fn same_walk(a: &KernelPass, b: &KernelPass) -> bool {
    is_fold(a)
        && a.grid == b.grid
        && a.image_of_fold().image_size() == b.image_of_fold().image_size()
        && pixels(a).any(|id| pixels(b).any(|other| other == id))
}

/// The images that a pass reads, and the files whose pixels it decodes.
fn pixels(pass: &KernelPass) -> impl Iterator<Item = ResourceId> + '_ {
    let ports = pass.stages.iter().flat_map(|s| &s.ports).filter(|p| matches!(p.shape, Shape::Image(_) | Shape::Pixels { .. }));
    ports.filter_map(|p| match p.source {
        Source::Read(r) => Some(pass.reads[r]),
        Source::Stage(_) => None,
    })
}

/// What all folds of a pass take of workgroup memory; they use the scratch one after the other.
fn workgroup_bytes(pass: &KernelPass) -> u32 {
    let own: u32 = pass.folds().map(|w| w.own).sum();
    own + 16 * pass.folds().map(|w| w.scratch).max().unwrap_or(0)
}
