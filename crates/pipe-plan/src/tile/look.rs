//! How passes look at what they read: at what is around a pixel, in its block, or anywhere.

use std::collections::BTreeMap;

use pipe_graph::pass::{Access, Border, Count, Entry, Grid, Reach, ResourceId, Shape, State, Stretch};

use crate::kernel_pass::{KernelPass, LoopOp, Op, Ops, Source, Stage};
use crate::window::Halo;

/// How a pass looks at something that it reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Look {
    /// At most so many pixels to each side.
    Around([u32; 2]),
    /// At the pixels of its block, and so many around them.
    Block([u32; 2]),
    /// Elsewhere, past the image's edges as the border says, through stages that look at nothing but their pixel.
    Elsewhere([Stretch; 2], Border),
    /// Anywhere.
    Whole,
}

impl Look {
    fn and(self, other: Self) -> Self {
        let max = |a: [u32; 2], b: [u32; 2]| [a[0].max(b[0]), a[1].max(b[1])];
        match (self, other) {
            (a, b) if a == b => a,
            (Self::Whole | Self::Elsewhere(..), _) | (_, Self::Whole | Self::Elsewhere(..)) => Self::Whole,
            (Self::Around(a), Self::Around(b)) => Self::Around(max(a, b)),
            (Self::Around(a) | Self::Block(a), Self::Around(b) | Self::Block(b)) => Self::Block(max(a, b)),
        }
    }

    /// A look of the first at values, each of which is made by a look of the second.
    fn through(self, inner: Self) -> Self {
        let add = |a: [u32; 2], b: [u32; 2]| [a[0].saturating_add(b[0]), a[1].saturating_add(b[1])];
        match (self, inner) {
            (look @ Self::Elsewhere(..), Self::Around([0, 0])) | (Self::Around([0, 0]), look @ Self::Elsewhere(..)) => look,
            (Self::Whole | Self::Elsewhere(..), _) | (_, Self::Whole | Self::Elsewhere(..)) => Self::Whole,
            (Self::Around(a), Self::Around(b)) => Self::Around(add(a, b)),
            (Self::Around(a) | Self::Block(a), Self::Around(b) | Self::Block(b)) => Self::Block(add(a, b)),
        }
    }
}

/// How a pass looks at the resource `read`, through whichever of its stages.
pub(super) fn look(pass: &KernelPass, read: usize) -> Look {
    let results = pass.writes.iter().map(|w| w.stage).chain([pass.stages.len() - 1]);
    // What drives a parameter is read by no port.
    results.filter_map(|s| look_of(pass, &pass.stages[s], read)).reduce(Look::and).unwrap_or(Look::Around([0, 0]))
}

/// The same for one stage; `None` where it does not look there.
fn look_of(pass: &KernelPass, stage: &Stage, read: usize) -> Option<Look> {
    let ports = stage.ports.iter().filter_map(|port| {
        let inner = match port.source {
            Source::Read(r) => (r == read).then_some(Look::Around([0, 0])),
            Source::Stage(k) => look_of(pass, &pass.stages[k], read),
        }?;
        let wraps = |x: u32, y: u32| port.border == Border::Repeat && (x, y) != (0, 0);
        let own = match port.reach {
            Reach::Point => Look::Around([0, 0]),
            // What lies beyond the other edge is never in the window.
            Reach::Around(x, y) if !wraps(x, y) => Look::Around([x, y]),
            Reach::Whole if port.once && pass.block().is_some() => Look::Block([0, 0]),
            Reach::Elsewhere(looks) if port.border != Border::Repeat => Look::Elsewhere(looks, port.border),
            Reach::Around(..) | Reach::Elsewhere(_) | Reach::Whole => Look::Whole,
        };
        Some(own.through(inner))
    });
    ports.reduce(Look::and)
}

/// Whether a pass can make a part of its pixels alone: the size of the whole image where it can.
pub(super) fn tileable(pass: &KernelPass, ops: &Ops) -> Option<[u32; 2]> {
    let size = pass.plane(ops)?;
    let entry = pass.last().entry;
    let grid = match pass.grid {
        Grid::Cover => {
            matches!(ops.shape(pass.writes[0].resource), Shape::Image(_)) && matches!(entry, Entry::Point | Entry::At | Entry::Each)
        }
        Grid::Blocks(_) => matches!(entry, Entry::Each | Entry::Kernel),
        Grid::Walk(_) => true,
        Grid::Pixels(_) => entry == Entry::Each,
        Grid::Elements(_) | Grid::Groups(_) => false,
    };
    let alike = pass.writes.iter().all(|w| match ops.shape(w.resource) {
        Shape::Image(t) => t.size == size && w.in_place_of.is_none(),
        Shape::Pixels { size: own, .. } => own == size,
        Shape::Volume(_) => false,
        // Where tiles overlap, pixels are made twice, but must be counted once.
        _ => w.access == Access::Store || !pass.makes_pixels(ops),
    });
    (grid && alike).then_some(size)
}

/// Resources that exist inside a loop only.
pub(super) fn loop_own(l: &LoopOp) -> Vec<ResourceId> {
    let body = l.body.iter().flat_map(Op::results);
    body.chain(l.states.iter().map(|s| s.carried)).collect()
}

/// How far all iterations of a loop look together; `None` for a loop that cannot run in a tile.
pub(super) fn loop_reach(l: &LoopOp) -> Option<Halo> {
    let Count::Fixed(n) = l.count else { return None };
    let mut far: BTreeMap<ResourceId, [u32; 2]> = BTreeMap::new();
    for op in &l.body {
        let Op::Pass(pass) = op else { return None };
        let mut own = [0, 0];
        for (read, id) in pass.reads.iter().enumerate() {
            let before = far.get(id).copied().unwrap_or_default();
            match look(pass, read) {
                Look::Around(reach) => own = [0, 1].map(|i| own[i].max(before[i].saturating_add(reach[i]))),
                // Tables and scalars from outside.
                Look::Whole | Look::Block(_) | Look::Elsewhere(..) => {}
            }
        }
        far.extend(pass.writes.iter().map(|w| (w.resource, own)));
    }
    let reaches = l.states.iter().map(|s: &State| far.get(&s.next).copied().unwrap_or_default());
    let most = reaches.fold([0, 0], |a, b| [a[0].max(b[0]), a[1].max(b[1])]);
    Some(Halo::around(most).times(n))
}
