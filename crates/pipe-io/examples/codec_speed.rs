//! How fast pictures are read and written: `cargo run --release --example codec_speed [WIDTH HEIGHT]`.
//!
//! The picture is a smooth gradient with a little noise, which is about as hard to compress as a rendering. Each line
//! is the best of three, in memory (no disk); the last two columns are of bands of 256 rows, to and from a file, with 16
//! rows of each neighbour on the way in.

#![allow(clippy::unwrap_used, missing_docs)]

use std::time::{Duration, Instant};

use pipe_io::{
    Channels, Compression, Format, Input, Metadata, Picture, ReadOptions, RowReader, RowWriter, Sample, Source, Target, WriteOptions,
    encode, output_form,
};

fn main() {
    let mut arguments = std::env::args().skip(1).map(|word| word.parse::<u32>().unwrap());
    let (width, height) = (arguments.next().unwrap_or(3840), arguments.next().unwrap_or(2160));
    println!("{width}×{height}; milliseconds");
    for (format, sample, channels, compression) in [
        (Format::Png, Sample::U8, Channels::Rgb, Some(Compression::Fastest)),
        (Format::Png, Sample::U8, Channels::Rgba, Some(Compression::Fastest)),
        (Format::Png, Sample::U16, Channels::Rgb, Some(Compression::Fastest)),
        (Format::Exr, Sample::F16, Channels::Rgb, Some(Compression::None)),
        (Format::Exr, Sample::F16, Channels::Rgb, Some(Compression::Zip)),
        (Format::Exr, Sample::F16, Channels::Rgb, Some(Compression::Zips)),
        (Format::Exr, Sample::F16, Channels::Rgb, Some(Compression::Piz)),
        (Format::Exr, Sample::F16, Channels::Rgb, Some(Compression::Dwab)),
        (Format::Exr, Sample::F32, Channels::Rgb, Some(Compression::Zip)),
        (Format::Tiff, Sample::U8, Channels::Rgb, None),
        (Format::Jpeg, Sample::U8, Channels::Rgb, None),
        (Format::WebP, Sample::U8, Channels::Rgb, None),
        (Format::Qoi, Sample::U8, Channels::Rgb, None),
        (Format::Hdr, Sample::F32, Channels::Rgb, None),
        (Format::Pfm, Sample::F32, Channels::Rgb, None),
    ] {
        let options = WriteOptions { pixel_type: Some(sample), channels: Some(channels), compression, ..WriteOptions::default() };
        let target = Target { path: None, format };
        let form = output_form(&target, &options, None).unwrap();
        let picture = form.picture(width, height, pixels(width, height, channels, sample, form.layout), Metadata::default());
        let (write, bytes) = best(|| encode(&target, &picture, &options).unwrap());
        let input = Input::from_bytes(&Source::file("memory"), bytes.clone(), &ReadOptions::default()).unwrap();
        let (read, _) = best(|| input.read().unwrap());
        let method = compression.map_or("", Compression::name);
        let megabytes = bytes.len() as f64 / 1e6;
        let [write, read] = [write, read].map(|time| time.as_secs_f64() * 1e3);
        print!("{:12} {:5} {:4} {method:8}", format.name(), sample.name(), channels.count());
        print!(" write {write:7.1}  read {read:7.1}  {megabytes:6.1} MB");
        let [write, read] = by_bands(&picture, format, &options).map(|time| time.as_secs_f64() * 1e3);
        println!("  by bands: write {write:7.1}  read {read:7.1}");
    }
}

/// The times to write a picture to a file by bands, and to read it again.
fn by_bands(picture: &Picture, format: Format, options: &WriteOptions) -> [Duration; 2] {
    const BAND: u32 = 256;
    const HALO: u32 = 16;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture");
    let target = Target { path: Some(path.clone()), format };
    let planes = if picture.layout == pipe_io::Layout::Planar { picture.channels.count() } else { 1 };
    let plane = picture.bytes.len() / planes;
    let row = plane / picture.height as usize;
    let tops = || (0..picture.height).step_by(BAND as usize);
    let (write, ()) = best(|| {
        let mut writer = RowWriter::create(&target, picture, options).unwrap();
        for top in tops() {
            let rows = top as usize * row..picture.height.min(top + BAND) as usize * row;
            let band: Vec<u8> = picture.bytes.chunks_exact(plane).flat_map(|plane| &plane[rows.clone()]).copied().collect();
            writer.write(&band).unwrap();
        }
        writer.finish().unwrap();
    });
    let (read, ()) = best(|| {
        let mut reader = RowReader::open(&Source::file(&path), &ReadOptions::default()).unwrap();
        let mut band = Vec::new();
        for top in tops() {
            reader.read(top.saturating_sub(HALO)..picture.height.min(top + BAND + HALO), &mut band).unwrap();
        }
    });
    [write, read]
}

fn best<T>(mut work: impl FnMut() -> T) -> (Duration, T) {
    let mut timed = || {
        let begun = Instant::now();
        let result = work();
        (begun.elapsed(), result)
    };
    let runs = [timed(), timed(), timed()];
    runs.into_iter().min_by_key(|(time, _)| *time).unwrap()
}

fn pixels(width: u32, height: u32, channels: Channels, sample: Sample, layout: pipe_io::Layout) -> Vec<u8> {
    let mut state = 1_u32;
    let count = channels.count() as u32;
    let plane = width * height;
    let mut bytes = Vec::new();
    for index in 0..plane * count {
        let (pixel, channel) = match layout {
            pipe_io::Layout::Planar => (index % plane, index / plane),
            pipe_io::Layout::Interleaved => (index / count, index % count),
        };
        let (x, y) = ((pixel % width) as f32 / width as f32, (pixel / width) as f32 / height as f32);
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (state >> 24) as f32 / 256.0;
        let value = 0.5 + 0.4 * (x * 9.0 + channel as f32).sin() * (y * 7.0).cos() + 0.01 * noise;
        match sample {
            Sample::U8 => bytes.push((value * 255.0) as u8),
            Sample::U16 => bytes.extend(((value * 65535.0) as u16).to_ne_bytes()),
            Sample::F16 => bytes.extend(half::f16::from_f32(value).to_ne_bytes()),
            Sample::F32 => bytes.extend(value.to_ne_bytes()),
        }
    }
    bytes
}
