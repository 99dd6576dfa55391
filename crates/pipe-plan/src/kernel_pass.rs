//! What the phases between lowering and scheduling work on: passes that may consist of several stages.
//!
//! A stage is one shader instance. Where a stage reads a pixel, it either loads a resource or asks an earlier
//! stage for its value at that place; so fusing two passes is nothing but putting both stages into one pass and
//! turning a load into such a question. A pass as a node declared it has one stage.

use std::collections::BTreeMap;
use std::ops::Range;

use indexmap::IndexMap;
use pipe_graph::pass::{
    Access, Border, Constant, Count, Entry, Filter, Grid, Item, NodeLabel, Pass, PassGraph, Reach, Resource, ResourceId, Shader, Shape,
    State, Value, Values, Workspace,
};

use crate::plan::Rect;
use crate::window::Windows;

/// Where a port's values come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Source {
    /// Position in [`KernelPass::reads`].
    Read(usize),
    /// An earlier stage of the pass.
    Stage(usize),
}

/// An input port of a stage.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StagePort {
    pub(crate) name: String,
    pub(crate) source: Source,
    pub(crate) shape: Shape,
    pub(crate) reach: Reach,
    pub(crate) once: bool,
    pub(crate) border: Border,
    pub(crate) filter: Filter,
}

impl StagePort {
    /// Width and height of the image that it reads.
    pub(crate) fn image_size(&self) -> [u32; 2] {
        match self.shape {
            Shape::Image(t) => t.size,
            _ => [1, 1],
        }
    }
}

/// One shader instance.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stage {
    pub(crate) shader: Shader,
    pub(crate) entry: Entry,
    pub(crate) constants: IndexMap<String, Constant>,
    pub(crate) params: IndexMap<String, Value>,
    pub(crate) ports: Vec<StagePort>,
    pub(crate) values: Values,
    /// The shape of its result; of its first output when it stores by itself.
    pub(crate) shape: Shape,
}

impl Stage {
    /// Width and height of an image result.
    pub(crate) fn shape_size(&self) -> Option<[u32; 2]> {
        match self.shape {
            Shape::Image(t) => Some(t.size),
            _ => None,
        }
    }
}

/// An output of a pass.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PassWrite {
    /// The stage whose value it is, or which stores it.
    pub(crate) stage: usize,
    pub(crate) port: String,
    pub(crate) resource: ResourceId,
    pub(crate) access: Access,
    pub(crate) in_place_of: Option<ResourceId>,
}

/// One launch to be.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct KernelPass {
    pub(crate) name: String,
    pub(crate) nodes: Vec<NodeLabel>,
    pub(crate) stages: Vec<Stage>,
    /// Distinct resources that are loaded by ports.
    pub(crate) reads: Vec<ResourceId>,
    pub(crate) writes: Vec<PassWrite>,
    pub(crate) grid: Grid,
}

impl KernelPass {
    fn new(pass: &Pass, graph: &PassGraph) -> Self {
        let mut reads = Vec::new();
        let port = |read: &pipe_graph::pass::Read, reads: &mut Vec<ResourceId>| {
            let at = reads.iter().position(|r| *r == read.resource).unwrap_or_else(|| {
                reads.push(read.resource);
                reads.len() - 1
            });
            StagePort {
                name: read.port.clone(),
                source: Source::Read(at),
                shape: graph.resource(read.resource).shape,
                reach: read.reach,
                once: read.once,
                border: read.border,
                filter: read.filter,
            }
        };
        let ports = pass.reads.iter().map(|r| port(r, &mut reads)).collect();
        let stage = Stage {
            shader: pass.shader.clone(),
            entry: pass.entry,
            constants: pass.constants.clone(),
            params: pass.params.clone(),
            ports,
            values: pass.values,
            shape: graph.resource(pass.writes[0].resource).shape,
        };
        let write = |w: &pipe_graph::pass::Write| PassWrite {
            stage: 0,
            port: w.port.clone(),
            resource: w.resource,
            access: w.access,
            in_place_of: w.in_place_of,
        };
        Self {
            name: pass.name.clone(),
            nodes: vec![pass.node],
            stages: vec![stage],
            reads,
            writes: pass.writes.iter().map(write).collect(),
            grid: pass.grid,
        }
    }

    /// The stage that gives the pass its entry.
    pub(crate) fn last(&self) -> &Stage {
        self.stages.last().expect("a pass has a stage")
    }

    /// Width and height of the pixels that it works on: of the first image (or pixels of a file) that it writes, or else
    /// of the one that it reads once.
    pub(crate) fn plane(&self, ops: &Ops) -> Option<[u32; 2]> {
        let written = self.writes.iter().find_map(|w| ops.shape(w.resource).plane());
        let once = || self.stages.iter().flat_map(|s| &s.ports).filter(|p| p.once).find_map(|p| p.shape.plane());
        written.or_else(once)
    }

    /// Width and height of the blocks in which it takes the pixels.
    pub(crate) const fn block(&self) -> Option<[u32; 2]> {
        match self.grid {
            Grid::Blocks(block) => Some(block),
            Grid::Walk(walk) => Some(walk.tile),
            _ => None,
        }
    }

    /// Whether it writes images or pixels of files.
    pub(crate) fn makes_pixels(&self, ops: &Ops) -> bool {
        self.writes.iter().any(|w| ops.shape(w.resource).plane().is_some())
    }

    /// The part of the grid that a tile runs: pixels, blocks, or (along x alone) groups of pixels of a file.
    pub(crate) fn grid_in(&self, ops: &Ops, windows: &Windows, tile: &Rect) -> Rect {
        let written = self.writes.iter().filter_map(|w| windows.window(w.resource, tile));
        let covered = written.reduce(|a, b| a.hull(&b)).unwrap_or_else(|| tile.clone());
        match (self.block(), self.grid) {
            (Some(block), _) => {
                // A block that makes pixels runs wherever the window meets it; others in the tile that they begin in.
                let makes_pixels = self.makes_pixels(ops);
                let first = |n: u32, i: usize| if makes_pixels { n / block[i] } else { n.div_ceil(block[i]) };
                let axis = |range: &Range<u32>, i: usize| first(range.start, i)..range.end.div_ceil(block[i]);
                Rect { x: axis(&covered.x, 0), y: axis(&covered.y, 1) }
            }
            (_, Grid::Pixels(per)) => Rect { x: 0..(covered.area().div_ceil(per.into())) as u32, y: 0..1 },
            _ => covered,
        }
    }

    /// The port of the image that a fold walks.
    pub(crate) fn image_of_fold(&self) -> &StagePort {
        self.last().ports.iter().find(|p| matches!(p.shape, Shape::Image(_))).expect("a fold reads an image")
    }

    /// What each of its folds needs of workgroup memory.
    pub(crate) fn folds(&self) -> impl Iterator<Item = Workspace> + '_ {
        self.stages.iter().filter_map(|s| match s.entry {
            Entry::Fold(workspace) => Some(workspace),
            _ => None,
        })
    }

    /// Scalars that drive parameters.
    pub(crate) fn drivers(&self) -> impl Iterator<Item = ResourceId> + '_ {
        self.stages.iter().flat_map(|s| s.params.values()).filter_map(|v| match v {
            Value::Driven(r) => Some(*r),
            _ => None,
        })
    }

    /// Every resource whose content it needs.
    pub(crate) fn sources(&self) -> impl Iterator<Item = ResourceId> + '_ {
        self.reads.iter().copied().chain(self.drivers()).chain(self.writes.iter().filter_map(|w| w.in_place_of))
    }
}

/// A loop over passes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LoopOp {
    pub(crate) name: String,
    pub(crate) node: NodeLabel,
    pub(crate) states: Vec<State>,
    pub(crate) body: Vec<Op>,
    pub(crate) count: Count,
}

/// A pass or a loop.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Op {
    Pass(KernelPass),
    Loop(LoopOp),
}

impl Op {
    /// Resources from outside that it needs.
    pub(crate) fn sources(&self) -> Vec<ResourceId> {
        match self {
            Self::Pass(pass) => pass.sources().collect(),
            Self::Loop(l) => {
                let mut inside = Vec::new();
                let mut needs: Vec<ResourceId> = l.states.iter().map(|s| s.init).collect();
                for op in &l.body {
                    needs.extend(op.sources());
                    inside.extend(op.results());
                }
                needs.extend(l.states.iter().map(|s| s.next));
                inside.extend(l.states.iter().map(|s| s.carried));
                needs.retain(|r| !inside.contains(r));
                needs.sort_unstable();
                needs.dedup();
                needs
            }
        }
    }

    /// Resources from outside whose storage it takes over: a loop copies what others need.
    pub(crate) fn takes_over(&self) -> Vec<ResourceId> {
        match self {
            Self::Pass(pass) => pass.writes.iter().filter_map(|w| w.in_place_of).collect(),
            Self::Loop(_) => Vec::new(),
        }
    }

    /// Whether it must run behind an earlier operation: it reads what that one makes, or overwrites what that one reads.
    pub(crate) fn comes_behind(&self, earlier: &Self) -> bool {
        let meet = |needed: &[ResourceId], there: &[ResourceId]| needed.iter().any(|id| there.contains(id));
        meet(&self.sources(), &earlier.results()) || meet(&self.takes_over(), &earlier.sources())
    }

    /// Gives resources other names, wherever it names them.
    pub(crate) fn rename(&mut self, names: &BTreeMap<ResourceId, ResourceId>) {
        let to = |id: &mut ResourceId| *id = names.get(id).copied().unwrap_or(*id);
        match self {
            Self::Pass(pass) => {
                pass.reads.iter_mut().for_each(to);
                pass.writes.iter_mut().flat_map(|w| [Some(&mut w.resource), w.in_place_of.as_mut()]).flatten().for_each(to);
                for value in pass.stages.iter_mut().flat_map(|s| s.params.values_mut()) {
                    if let Value::Driven(id) = value {
                        to(id);
                    }
                }
            }
            Self::Loop(l) => {
                l.states.iter_mut().flat_map(|s| [&mut s.init, &mut s.carried, &mut s.next, &mut s.result]).for_each(to);
                l.body.iter_mut().for_each(|op| op.rename(names));
            }
        }
    }

    /// Resources that later operations may read.
    pub(crate) fn results(&self) -> Vec<ResourceId> {
        match self {
            Self::Pass(pass) => pass.writes.iter().map(|w| w.resource).collect(),
            Self::Loop(l) => l.states.iter().map(|s| s.result).collect(),
        }
    }
}

/// Images that are made tile by tile: the body runs for each tile.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TilingOp {
    /// What runs, over resources of the tiling's own where only a window is held.
    pub(crate) body: Vec<Op>,
    pub(crate) windows: Windows,
    /// Pixels of files that the host brings for each tile.
    pub(crate) uploads: Vec<Brought>,
    /// Pixels that the host takes after each tile.
    pub(crate) fetches: Vec<Brought>,
    /// Pixels that are computed for each that is wanted.
    pub(crate) work: f32,
}

/// One plane of a picture that crosses the rim tile by tile.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Brought {
    /// The external, or the fetch.
    pub(crate) name: String,
    pub(crate) plane: u32,
    pub(crate) resource: ResourceId,
}

/// A part of a schedule.
#[derive(Debug, Clone)]
pub(crate) enum Portion {
    /// Over whole images.
    Whole(Vec<Op>),
    /// Tile by tile.
    Tiles(TilingOp),
}

impl Portion {
    pub(crate) fn ops(&self) -> &[Op] {
        match self {
            Self::Whole(ops) => ops,
            Self::Tiles(tiling) => &tiling.body,
        }
    }

    pub(crate) const fn tiling(&self) -> Option<&TilingOp> {
        match self {
            Self::Whole(_) => None,
            Self::Tiles(tiling) => Some(tiling),
        }
    }
}

/// A pass graph whose passes may be fused.
#[derive(Debug, Clone)]
pub(crate) struct Ops {
    pub(crate) resources: Vec<Resource>,
    pub(crate) nodes: Vec<String>,
    pub(crate) ops: Vec<Op>,
    pub(crate) fetches: Vec<pipe_graph::pass::Fetch>,
    pub(crate) kept: Vec<pipe_graph::pass::Kept>,
}

impl Ops {
    /// One stage a pass.
    pub(crate) fn new(graph: PassGraph) -> Self {
        fn convert(items: &[Item], graph: &PassGraph) -> Vec<Op> {
            let one = |item: &Item| match item {
                Item::Pass(pass) => Op::Pass(KernelPass::new(pass, graph)),
                Item::Loop(l) => Op::Loop(LoopOp {
                    name: l.name.clone(),
                    node: l.node,
                    states: l.states.clone(),
                    body: convert(&l.body, graph),
                    count: l.count.clone(),
                }),
            };
            items.iter().map(one).collect()
        }
        let ops = convert(&graph.items, &graph);
        Self { resources: graph.resources, nodes: graph.nodes, ops, fetches: graph.fetches, kept: graph.kept }
    }

    pub(crate) fn shape(&self, id: ResourceId) -> Shape {
        self.resources[id.index()].shape
    }

    /// Resources that must be there when everything has run.
    pub(crate) fn wanted(&self) -> impl Iterator<Item = ResourceId> + '_ {
        let fetched = self.fetches.iter().flat_map(|f| f.parts.iter().map(|(r, _)| *r));
        fetched.chain(self.kept.iter().map(|kept| kept.resource))
    }
}
