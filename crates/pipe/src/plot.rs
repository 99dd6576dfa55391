//! A table as bars: SVG for documents, PNG for a quick look. Two colours and no text: the numbers are in the CSV.

use std::fmt::Write as _;
use std::path::Path;

use pipe_io::atomic::AtomicFile;
use pipe_io::table::Table;
use pipe_io::{Alpha, Channels, Colour, Layout, Metadata, Picture, Sample, Target, WriteOptions};

use crate::Failure;

const WIDTH: usize = 768;
const HEIGHT: usize = 256;
const BACK: [u8; 3] = [250, 250, 250];
const BAR: [u8; 3] = [49, 130, 189];

/// Whether a path asks for a plot.
pub fn is_plot(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg") || e.eq_ignore_ascii_case("png"))
}

/// Writes the plot, whole or not at all.
pub fn write(path: &Path, table: &Table) -> Result<(), Failure> {
    let values: Vec<f64> = match table {
        Table::Float(v) => v.iter().map(|v| f64::from(*v)).collect(),
        Table::Uint(v) => v.iter().map(|v| f64::from(*v)).collect(),
    };
    let heights = columns(&values);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg")) {
        let text = svg(&heights);
        return AtomicFile::write_whole(Some(path), text.as_bytes())
            .map_err(|e| Failure::World(format!("cannot write `{}`: {e}", path.display())));
    }
    let picture = Picture {
        width: WIDTH as u32,
        height: HEIGHT as u32,
        sample: Sample::U8,
        layout: Layout::Interleaved,
        channels: Channels::Rgb,
        alpha: Alpha::None,
        colour: Colour { primaries: pipe_io::Primaries::REC709, transfer: pipe_io::Transfer::Srgb },
        bytes: raster(&heights),
        metadata: Metadata::default(),
    };
    pipe_io::write(&Target::parse(&path.to_string_lossy())?, &picture, &WriteOptions::default())?;
    Ok(())
}

/// The height of each of `WIDTH` columns in 0..1: the largest entry that falls into it over the largest of all.
fn columns(values: &[f64]) -> Vec<f64> {
    let finite = |v: &f64| v.is_finite().then_some(*v);
    let most = values.iter().filter_map(finite).fold(0.0, f64::max);
    let column = |x: usize| {
        let (from, to) = (x * values.len() / WIDTH, ((x + 1) * values.len()).div_ceil(WIDTH));
        let v = values[from.min(values.len() - 1)..to.max(from + 1).min(values.len())].iter().filter_map(finite).fold(0.0, f64::max);
        if most > 0.0 { v / most } else { 0.0 }
    };
    if values.is_empty() { vec![0.0; WIDTH] } else { (0..WIDTH).map(column).collect() }
}

fn svg(heights: &[f64]) -> String {
    let hex = |c: [u8; 3]| format!("#{:02x}{:02x}{:02x}", c[0], c[1], c[2]);
    let mut path = format!("M0 {HEIGHT}");
    for (x, h) in heights.iter().enumerate() {
        let y = HEIGHT as f64 * (1.0 - h);
        let _ = write!(path, "L{x} {y:.2}L{} {y:.2}", x + 1);
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\"><rect width=\"100%\" height=\"100%\" fill=\"{}\"/><path d=\"{path}L{WIDTH} {HEIGHT}Z\" fill=\"{}\"/></svg>\n",
        hex(BACK),
        hex(BAR)
    )
}

fn raster(heights: &[f64]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(WIDTH * HEIGHT * 3);
    for y in 0..HEIGHT {
        for h in heights {
            let inside = (HEIGHT - y) as f64 <= h * HEIGHT as f64;
            bytes.extend(if inside { BAR } else { BACK });
        }
    }
    bytes
}
