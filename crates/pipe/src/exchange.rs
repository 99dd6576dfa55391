//! Pixels between files and a plan that works tile by tile: a few rows at a time, so that no picture is ever held whole.

use std::collections::HashMap;
use std::ops::Range;

use pipe_gpu::{Exchange, Rows};
use pipe_io::{ReadAhead, WriteBehind};
use pipe_plan::plan::{Crossing, Plan, Rect};

use crate::Failure;
use crate::run::{Decoded, Inputs};

/// An output whose tiles arrive.
struct Arriving {
    /// Where its rows go: into a file, which appears at the end; without one, into memory.
    file: Option<WriteBehind>,
    whole: Vec<u8>,
    /// Rows that arrive now, and bytes of them that did.
    rows: Range<u32>,
    band: Vec<u8>,
    arrived: usize,
    planes: u32,
}

/// Outputs all of whose tiles arrived.
pub(crate) struct Arrived {
    /// Files that want to be finished.
    pub(crate) files: HashMap<String, WriteBehind>,
    /// Pixels of the others.
    pub(crate) bytes: HashMap<String, Vec<u8>>,
}

/// The pictures of a run.
pub(crate) struct Pictures<'a> {
    inputs: HashMap<&'a str, Source<'a>>,
    outputs: HashMap<String, Arriving>,
}

/// Where the rows of an input come from.
enum Source<'a> {
    Memory { bytes: &'a [u8], rows: Range<u32> },
    File { bands: ReadAhead, rows: Range<u32>, band: Vec<u8> },
}

impl<'a> Pictures<'a> {
    /// Takes the tiles of a plan from these pictures; those that are still files begin to be read now.
    pub(crate) fn of(inputs: &'a Inputs, plan: &Plan) -> Result<Self, Failure> {
        let mut sources = HashMap::new();
        for (name, decoded) in inputs {
            match &**decoded {
                Decoded::Picture(p) => drop(sources.insert(name.as_str(), Source::Memory { bytes: &p.bytes, rows: 0..p.height })),
                Decoded::Distant(distant) => {
                    let bands = bands(plan, name);
                    if !bands.is_empty() {
                        let bands = distant.rows()?.ahead(bands);
                        sources.insert(name.as_str(), Source::File { bands, rows: 0..0, band: Vec::new() });
                    }
                }
                Decoded::Volume(_) | Decoded::Table(_) => {}
            }
        }
        Ok(Self { inputs: sources, outputs: HashMap::new() })
    }

    /// Puts the tiles of one more plane of an output together, in a file or in memory.
    pub(crate) fn collect(&mut self, name: &str, file: Option<WriteBehind>) {
        let new = || Arriving { file: None, whole: Vec::new(), rows: 0..0, band: Vec::new(), arrived: 0, planes: 0 };
        let arriving = self.outputs.entry(name.to_owned()).or_insert_with(new);
        arriving.planes += 1;
        arriving.file = arriving.file.take().or(file);
    }

    /// The outputs.
    pub(crate) fn arrived(self) -> Arrived {
        let mut arrived = Arrived { files: HashMap::new(), bytes: HashMap::new() };
        for (name, output) in self.outputs {
            match output.file {
                Some(file) => drop(arrived.files.insert(name, file)),
                None => drop(arrived.bytes.insert(name, output.whole)),
            }
        }
        arrived
    }
}

impl Exchange for Pictures<'_> {
    fn rows(&mut self, from: &Crossing) -> Result<Rows<'_>, String> {
        match self.inputs.get_mut(from.name.as_str()) {
            Some(Source::Memory { bytes, rows }) => Ok(Rows { bytes, rows: rows.clone() }),
            Some(Source::File { bands, rows, band }) => {
                if *rows != from.rect.y {
                    bands.reuse(std::mem::take(band));
                    let next = bands.next().ok_or_else(|| format!("`{}` has no more rows", from.name))?;
                    *band = next.map_err(|e| e.to_string())?;
                    rows.clone_from(&from.rect.y);
                }
                Ok(Rows { bytes: band, rows: rows.clone() })
            }
            None => Err(format!("there are no pixels for `{}`", from.name)),
        }
    }

    fn put(&mut self, to: &Crossing, bytes: &[u8]) -> Result<(), String> {
        let arriving = self.outputs.get_mut(&to.name).ok_or_else(|| format!("nobody takes `{}`", to.name))?;
        let rows = &to.rect.y;
        if arriving.rows != *rows {
            let band = Crossing { plane: arriving.planes - 1, rect: Rect { x: 0..to.size[0], y: rows.clone() }, ..to.clone() };
            arriving.band.resize(band.ranges(rows)[0].end as usize, 0);
            arriving.rows = rows.clone();
            arriving.arrived = 0;
        }
        let mut rest = bytes;
        for range in to.ranges(rows) {
            let (row, tail) = rest.split_at((range.end - range.start) as usize);
            arriving.band[range.start as usize..range.end as usize].copy_from_slice(row);
            rest = tail;
        }
        arriving.arrived += bytes.len();
        if arriving.arrived < arriving.band.len() {
            return Ok(());
        }
        match &mut arriving.file {
            Some(file) => arriving.band = file.write(std::mem::take(&mut arriving.band)).map_err(|e| e.to_string())?,
            None => arriving.keep(to.size[1] as usize),
        }
        arriving.rows = 0..0;
        Ok(())
    }
}

/// The rows of a picture that the tiles of a plan ask for, in their order.
fn bands(plan: &Plan, name: &str) -> Vec<Range<u32>> {
    let tiles = plan.tilings().flat_map(|t| &t.tiles);
    let mut rows: Vec<_> = tiles.flat_map(|tile| &tile.uploads).filter(|u| u.name == name).map(|u| u.rect.y.clone()).collect();
    rows.dedup();
    rows
}

impl Arriving {
    /// Copies the rows of every plane to their place in the whole picture.
    fn keep(&mut self, height: usize) {
        let plane = self.band.len() / self.planes as usize;
        let row = plane / self.rows.len();
        self.whole.resize(self.planes as usize * height * row, 0);
        for (rows, whole) in self.band.chunks_exact(plane).zip(self.whole.chunks_exact_mut(height * row)) {
            let at = self.rows.start as usize * row;
            whole[at..at + plane].copy_from_slice(rows);
        }
    }
}
