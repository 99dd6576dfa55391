//! Follows the pixels of every tile forwards, from what the host brings: which of them are *valid*, that is made of valid ones
//! alone, as if the image had been there whole. The planner computes how wide windows must be backwards, from the last pass;
//! nothing of that is used here, only which rectangle each window is and which part of its grid each pass runs.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use pipe_graph::pass::{Access, Border, Count, Grid, Origin, Reach, ResourceId, Stretch};

use crate::kernel_pass::{KernelPass, LoopOp, Op, Ops, Portion, Source, TilingOp};
use crate::plan::Rect;
use crate::schedule::Schedule;

/// Columns and rows.
type Area = [Range<u32>; 2];

/// How often each block of a pass ran, by the name of the pass.
type Runs = BTreeMap<String, BTreeMap<[u32; 2], u32>>;

/// What is wrong with a schedule over tiles.
pub(super) fn check(schedule: &Schedule) -> Result<(), String> {
    let ops = &schedule.ops;
    let there = (0..).map(ResourceId).zip(&ops.resources).filter(|(_, r)| !matches!(r.origin, Origin::Pass | Origin::State));
    let mut complete: BTreeSet<ResourceId> = there.map(|(id, _)| id).collect();
    for portion in &schedule.portions {
        match portion {
            Portion::Whole(list) => {
                for op in list {
                    if let Some(id) = op.sources().iter().find(|id| !complete.contains(id)) {
                        return Err(format!("{} is read whole before it is there", ops.resources[id.index()].name));
                    }
                    complete.extend(op.results());
                }
            }
            Portion::Tiles(tiling) => complete.extend(round(tiling, ops, &complete)?),
        }
    }
    match ops.wanted().find(|id| !complete.contains(id)) {
        Some(id) => Err(format!("nobody makes {}", ops.resources[id.index()].name)),
        None => Ok(()),
    }
}

/// All tiles of a round; answers what they leave whole.
fn round(tiling: &TilingOp, ops: &Ops, complete: &BTreeSet<ResourceId>) -> Result<Vec<ResourceId>, String> {
    let tiles = tiling.windows.tiles();
    let mut painted: BTreeMap<ResourceId, Vec<u32>> = BTreeMap::new();
    let mut runs = Runs::new();
    for tile in &tiles {
        let mut at = AtTile { tiling, ops, complete, tile, valid: BTreeMap::new(), runs: &mut runs };
        for upload in &tiling.uploads {
            let window = at.window(upload.resource).ok_or("what is brought tile by tile has no window")?;
            at.valid.insert(upload.resource, window);
        }
        for op in &tiling.body {
            match op {
                Op::Pass(pass) => at.pass(pass)?,
                Op::Loop(l) => at.repeat(l)?,
            }
        }
        for fetch in &tiling.fetches {
            let window = at.window(fetch.resource).ok_or("what is taken tile by tile has no window")?;
            let valid = at.valid.get(&fetch.resource).ok_or_else(|| format!("nobody makes {}", fetch.name))?;
            if !covers(valid, &window) {
                return Err(format!("{}: of {window:?} only {valid:?} is valid", fetch.name));
            }
            let [w, h] = tiling.windows.size_of(fetch.resource);
            let counts = painted.entry(fetch.resource).or_insert_with(|| vec![0; (w * h) as usize]);
            let [columns, rows] = window;
            for y in rows {
                columns.clone().for_each(|x| counts[(y * w + x) as usize] += 1);
            }
        }
    }
    if painted.values().flatten().any(|n| *n != 1) {
        return Err("the tiles do not cover what is fetched exactly once".to_owned());
    }
    let mut whole = Vec::new();
    for pass in tiling.body.iter().filter_map(|op| if let Op::Pass(pass) = op { Some(pass) } else { None }) {
        for write in pass.writes.iter().filter(|w| !tiling.windows.views.contains_key(&w.resource)) {
            if ops.shape(write.resource).plane().is_none() {
                every_block(pass, write.access, tiling.windows.size, &runs)?;
            }
            whole.push(write.resource);
        }
    }
    Ok(whole)
}

/// Every block must run; exactly once where it adds to something, or where it makes nothing else.
fn every_block(pass: &KernelPass, access: Access, size: [u32; 2], runs: &Runs) -> Result<(), String> {
    let block = pass.block().unwrap_or([1, 1]);
    let runs = &runs[&pass.name];
    let once = access != Access::Store;
    for y in 0..size[1].div_ceil(block[1]) {
        for x in 0..size[0].div_ceil(block[0]) {
            let n = runs.get(&[x, y]).copied().unwrap_or(0);
            if n == 0 || once && n > 1 {
                return Err(format!("{}: block {x}, {y} runs {n} times", pass.name));
            }
        }
    }
    Ok(())
}

fn covers(outer: &Area, inner: &Area) -> bool {
    (0..2).all(|i| inner[i].is_empty() || outer[i].start <= inner[i].start && outer[i].end >= inner[i].end)
}

fn both(a: &Area, b: &Area) -> Area {
    std::array::from_fn(|i| {
        let start = a[i].start.max(b[i].start);
        start..a[i].end.min(b[i].end).max(start)
    })
}

/// The pixels whose surroundings are valid, where the image ends being no hindrance.
fn within(valid: &Area, reach: [u32; 2], size: [u32; 2]) -> Area {
    std::array::from_fn(|i| {
        let start = if valid[i].start == 0 { 0 } else { valid[i].start.saturating_add(reach[i]) };
        let end = if valid[i].end == size[i] { size[i] } else { valid[i].end.saturating_sub(reach[i]) };
        if valid[i].is_empty() { 0..0 } else { start..end.max(start) }
    })
}

/// Those of some pixels that look at valid ones only, pixel by pixel.
fn looking_at(valid: &Area, there: [u32; 2], looks: [Stretch; 2], border: Border, of: &Area) -> Area {
    let mut area = [0..0, 0..0];
    for (i, look) in looks.into_iter().enumerate() {
        let n = i64::from(there[i]);
        let place = |x: i64| match border {
            // Reflections of reflections too.
            Border::Mirror => x.rem_euclid(2 * n).min(2 * n - 1 - x.rem_euclid(2 * n)),
            _ => x.clamp(0, n - 1),
        };
        let good = |at: &u32| {
            let first = look.first_of(*at);
            (first..first + i64::from(look.count)).all(|x| valid[i].contains(&(place(x) as u32)))
        };
        let of = of[look.along].clone();
        let first = of.clone().find(good).unwrap_or(of.end);
        area[look.along] = first..(first..of.end).find(|at| !good(at)).unwrap_or(of.end);
    }
    area
}

struct AtTile<'a> {
    tiling: &'a TilingOp,
    ops: &'a Ops,
    /// What was whole before the first tile.
    complete: &'a BTreeSet<ResourceId>,
    tile: &'a Rect,
    /// Of what is held in part.
    valid: BTreeMap<ResourceId, Area>,
    runs: &'a mut Runs,
}

impl AtTile<'_> {
    fn window(&self, id: ResourceId) -> Option<Area> {
        self.tiling.windows.window(id, self.tile).map(|r| [r.x, r.y])
    }

    fn repeat(&mut self, l: &LoopOp) -> Result<(), String> {
        let Count::Fixed(times) = l.count else { return Err(format!("{} ends by a value, in a tile", l.name)) };
        let missing = || format!("{} begins with what is not there", l.name);
        let states: Option<Vec<Area>> = l.states.iter().map(|s| self.valid.get(&s.init).cloned()).collect();
        let mut states = states.ok_or_else(missing)?;
        for _ in 0..times {
            for (state, area) in l.states.iter().zip(states) {
                self.valid.insert(state.carried, area);
            }
            for op in &l.body {
                match op {
                    Op::Pass(pass) => self.pass(pass)?,
                    Op::Loop(inner) => self.repeat(inner)?,
                }
            }
            states = l.states.iter().map(|s| self.valid.get(&s.next).cloned()).collect::<Option<_>>().ok_or_else(missing)?;
        }
        for (state, area) in l.states.iter().zip(states) {
            let window = self.window(state.result).ok_or_else(missing)?;
            self.valid.insert(state.result, both(&area, &window));
        }
        Ok(())
    }

    fn pass(&mut self, pass: &KernelPass) -> Result<(), String> {
        let size = self.tiling.windows.size_of(pass.writes[0].resource);
        let full: Area = [0..size[0], 0..size[1]];
        let grid = pass.grid_in(self.ops, &self.tiling.windows, self.tile);
        let grid: Area = [grid.x, grid.y];
        // The pixels that it makes: those of its windows, or all of its blocks.
        let windows = pass.writes.iter().filter_map(|w| self.tiling.windows.window(w.resource, self.tile));
        let asked = windows.reduce(|a, b| a.hull(&b)).unwrap_or_else(|| self.tile.clone());
        let asked: Area = match pass.block() {
            Some(block) => std::array::from_fn(|i| grid[i].start * block[i]..(grid[i].end * block[i]).min(size[i])),
            None => [asked.x, asked.y],
        };
        if pass.drivers().any(|id| !self.complete.contains(&id)) {
            return Err(format!("{} is driven by what is not there", pass.name));
        }
        // Where the value of each stage is valid, and what must be valid over the whole of a block.
        let mut stages: Vec<Area> = Vec::new();
        let mut blockwise = full.clone();
        for stage in &pass.stages {
            let mut area = full.clone();
            for port in &stage.ports {
                let (from, there) = match port.source {
                    Source::Stage(k) => (stages[k].clone(), size),
                    Source::Read(r) => self.valid_of(pass, pass.reads[r])?,
                };
                if from == [0..there[0], 0..there[1]] {
                    continue;
                }
                match port.reach {
                    Reach::Point | Reach::Around(0, 0) => area = both(&area, &from),
                    Reach::Around(x, y) if port.border != Border::Repeat => area = both(&area, &within(&from, [x, y], size)),
                    Reach::Whole if port.once && pass.block().is_some() => blockwise = both(&blockwise, &from),
                    Reach::Elsewhere(looks) if port.border != Border::Repeat => {
                        area = both(&area, &looking_at(&from, there, looks, port.border, &asked));
                    }
                    Reach::Around(..) | Reach::Elsewhere(_) | Reach::Whole => return Err(format!("{} looks beyond {from:?}", pass.name)),
                }
            }
            stages.push(area);
        }
        let computed = self.computed(pass, &grid, &blockwise)?;
        for write in &pass.writes {
            let valid = both(&computed, &stages[write.stage]);
            if let Some(window) = self.window(write.resource) {
                self.valid.insert(write.resource, both(&valid, &window));
            } else if self.ops.shape(write.resource).plane().is_some() {
                let tile = [self.tile.x.clone(), self.tile.y.clone()];
                if !covers(&valid, &tile) {
                    return Err(format!("{} leaves only {valid:?} of {tile:?} whole", pass.name));
                }
            } else if pass.block().is_some() || pass.grid == Grid::Cover {
                // A block that runs leaves something, so it had better be right.
                let block = pass.block().unwrap_or([1, 1]);
                let wanted: Area = std::array::from_fn(|i| grid[i].start * block[i]..(grid[i].end * block[i]).min(size[i]));
                if !grid.iter().any(Range::is_empty) && !covers(&valid, &wanted) {
                    return Err(format!("{} is valid in {valid:?} of the blocks {wanted:?}", pass.name));
                }
            } else {
                return Err(format!("{} leaves a table without blocks", pass.name));
            }
        }
        let [columns, rows] = grid;
        let runs = self.runs.entry(pass.name.clone()).or_default();
        for y in rows {
            columns.clone().for_each(|x| *runs.entry([x, y]).or_default() += 1);
        }
        Ok(())
    }

    /// Where something that a pass reads is valid: everywhere when it is whole.
    /// With its size.
    fn valid_of(&self, pass: &KernelPass, id: ResourceId) -> Result<(Area, [u32; 2]), String> {
        if self.window(id).is_some() {
            let valid = self.valid.get(&id).cloned().ok_or_else(|| format!("{} reads what nobody made", pass.name))?;
            return Ok((valid, self.tiling.windows.size_of(id)));
        }
        if !self.complete.contains(&id) {
            return Err(format!("{} reads {} before it is complete", pass.name, self.ops.resources[id.index()].name));
        }
        let [w, h] = self.ops.shape(id).plane().unwrap_or(self.tiling.windows.size);
        Ok(([0..w, 0..h], [w, h]))
    }

    /// The pixels that are computed of what is there: all of the grid, or those of blocks that are there whole.
    fn computed(&self, pass: &KernelPass, grid: &Area, blockwise: &Area) -> Result<Area, String> {
        let size = self.tiling.windows.size_of(pass.writes[0].resource);
        if let Some(block) = pass.block() {
            return Ok(std::array::from_fn(|i| {
                let pixels = |b: u32| b * block[i]..((b + 1) * block[i]).min(size[i]);
                let there = |b: &u32| blockwise[i].start <= pixels(*b).start && pixels(*b).end <= blockwise[i].end;
                let valid: Vec<u32> = grid[i].clone().filter(there).collect();
                match (valid.first(), valid.last()) {
                    (Some(first), Some(last)) => pixels(*first).start..pixels(*last).end,
                    _ => 0..0,
                }
            }));
        }
        if let Grid::Pixels(per) = pass.grid {
            let window = self.window(pass.writes[0].resource).ok_or("pixels of a file are held whole")?;
            let area: u32 = window.iter().map(|r| r.end - r.start).product();
            let enough = grid[0].start == 0 && grid[0].end * per >= area;
            return enough.then_some(window).ok_or_else(|| format!("{} does not pack every pixel", pass.name));
        }
        Ok(grid.clone())
    }
}
