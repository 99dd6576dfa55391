//! `compare`: two images, in numbers.

use pipe::Failure;
use pipe::compare::compare_files;
use pipe_io::{Alpha, Channels, Colour, Layout, Metadata, Picture, Primaries, Sample, Target, Transfer, WriteOptions};

use super::args::CompareArgs;
use super::{print, print_json};

/// Exit code 1 when more than `--fail-percent` of the pixels differ by more than `--fail`.
pub(super) fn compare(a: &CompareArgs) -> Result<(), Failure> {
    let c = compare_files(&a.a, &a.b, a.fail)?;
    if let Some(file) = &a.diff {
        let scale = if c.max_abs > 0.0 && c.max_abs.is_finite() { 255.0 / c.max_abs } else { 255.0 };
        let bytes = c.map.iter().map(|d| (f64::from(*d) * scale).clamp(0.0, 255.0) as u8).collect();
        let picture = Picture {
            width: c.size[0],
            height: c.size[1],
            sample: Sample::U8,
            layout: Layout::Interleaved,
            channels: Channels::Y,
            alpha: Alpha::None,
            colour: Colour { primaries: Primaries::REC709, transfer: Transfer::Srgb },
            bytes,
            metadata: Metadata::default(),
        };
        pipe_io::write(&Target::parse(file)?, &picture, &WriteOptions::default())?;
    }
    if a.json {
        print_json(&c.to_json())?;
    } else {
        let w = &c.worst;
        print(&format!(
            "max {:e}  mean {:e}  rms {:e}  psnr {:.2} dB  flip {:.5}\n{:.4} % of pixels differ by more than {:e}; worst at ({}, {}) channel {}: {} and {}\n",
            c.max_abs, c.mean_abs, c.rms, c.psnr_db, c.flip_mean, c.different_percent, a.fail, w.x, w.y, w.channel, w.a, w.b
        ))?;
    }
    if c.different_percent > a.fail_percent { Err(Failure::Differs) } else { Ok(()) }
}
