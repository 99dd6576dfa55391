//! `compare`: two images, in numbers.

use pipe::Failure;
use pipe::compare::{Comparison, compare_files};
use pipe_io::{Channels, Metadata, Sample, Source, Target, WriteOptions, output_form};

use super::args::CompareArgs;
use super::targets::real;
use super::{print, print_json};

/// Exit code 1 when more than `--fail-percent` of the pixels differ by more than `--fail`.
pub(super) fn compare(a: &CompareArgs) -> Result<(), Failure> {
    for (flag, limit) in [("--fail", a.fail), ("--fail-percent", a.fail_percent)] {
        // Nothing is more than NaN, so everything would pass.
        if !(limit.is_finite() && limit >= 0.0) {
            return Err(Failure::Graph(format!("{flag} {limit}: expected 0 or more")));
        }
    }
    let diff = a.diff.as_deref().map(Target::parse).transpose()?;
    if let Some(target) = &diff {
        let Some(file) = target.path.as_deref() else {
            return Err(Failure::Graph("--diff -: stdout has the numbers\n  next: name a file".into()));
        };
        let same = |name: &&String| Source::parse(name).path.is_some_and(|path| real(&path) == real(file));
        if let Some(input) = [&a.a, &a.b].into_iter().find(same) {
            let file = file.display();
            return Err(Failure::Graph(format!("--diff {file} would overwrite {input}\n  next: choose another name")));
        }
    }
    let c = compare_files(&a.a, &a.b, a.fail)?;
    if let Some(target) = &diff {
        write_map(target, &c)?;
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

/// The difference at each pixel, as it is in formats of floats; where values are 0 to 1, the largest is white.
fn write_map(target: &Target, c: &Comparison) -> Result<(), Failure> {
    let options = WriteOptions { channels: Some(Channels::Y), ..WriteOptions::default() };
    let form = output_form(target, &options, None)?;
    let scale = if c.max_abs > 0.0 && c.max_abs.is_finite() { 255.0 / c.max_abs } else { 255.0 };
    let each = c.map.iter().flat_map(|d| std::iter::repeat_n(*d, form.channels.count()));
    let bytes = match form.sample {
        Sample::F32 => each.flat_map(f32::to_ne_bytes).collect(),
        // Without a wish the other formats have bytes.
        _ => each.map(|d| (f64::from(d) * scale).clamp(0.0, 255.0) as u8).collect(),
    };
    pipe_io::write(target, &form.picture(c.size[0], c.size[1], bytes, Metadata::default()), &options)?;
    Ok(())
}
