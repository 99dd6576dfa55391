//! Bands of rows are the rows of the whole picture, on the way in and on the way out.

#![allow(clippy::unwrap_used)] // a test may stop where it stands

use std::ops::Range;
use std::path::{Path, PathBuf};

use pipe_io::{
    Channels, Compression, Error, Format, Layout, Metadata, Picture, ReadOptions, RowReader, RowWriter, Sample, Source, Target,
    WriteOptions, encode, output_form, read,
};

const WIDTH: u32 = 61;
/// More than a block of any compression but DWAB, and not a multiple of one.
const HEIGHT: u32 = 147;
const BANDS: [u32; 5] = [1, 7, 16, 33, u32::MAX];

fn data(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(folder)
}

/// A smooth picture with some noise in the form that a target wants, the same every time.
fn picture(format: Format, height: u32, options: &WriteOptions) -> Picture {
    let form = output_form(&Target { path: None, format }, options, None).unwrap();
    let mut state = 7_u32;
    let mut bytes = Vec::new();
    for index in 0..(WIDTH * height) as usize * form.channels.count() {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let value = (index as f32 / 1000.0).sin() * 0.4 + 0.5 + (state >> 16) as f32 / 65536.0 * 0.05;
        match form.sample {
            Sample::U8 => bytes.push((value * 255.0) as u8),
            Sample::U16 => bytes.extend(((value * 65535.0) as u16).to_ne_bytes()),
            Sample::F16 => bytes.extend(half::f16::from_f32(value * 3.0).to_ne_bytes()),
            Sample::F32 => bytes.extend((value * 3.0).to_ne_bytes()),
        }
    }
    form.picture(WIDTH, height, bytes, Metadata::default())
}

/// Some rows of a picture, as a band has them.
fn cut(picture: &Picture, rows: &Range<u32>) -> Vec<u8> {
    let planes = if picture.layout == Layout::Planar { picture.channels.count() } else { 1 };
    let plane = picture.bytes.len() / planes;
    let row = plane / picture.height as usize;
    let rows = rows.start as usize * row..rows.end as usize * row;
    picture.bytes.chunks_exact(plane).flat_map(|plane| &plane[rows.clone()]).copied().collect()
}

/// Bands of so many rows, each with some rows of its neighbours.
fn bands(height: u32, band: u32, overlap: u32) -> impl Iterator<Item = Range<u32>> {
    let band = band.min(height);
    (0..height).step_by(band as usize).map(move |top| top.saturating_sub(overlap)..(top + band + overlap).min(height))
}

/// Reads a file by bands of every height, twice from the top, and compares with what `read` gives.
fn compare(source: &Source, options: &ReadOptions) {
    let whole = read(source, options).unwrap();
    for (height, overlap) in [(1, 0), (1, 2), (7, 19), (16, 0), (16, 2), (33, 70), (u32::MAX, 0)] {
        let mut reader = RowReader::open(source, options).unwrap();
        let header = reader.header();
        assert_eq!(
            (header.width, header.height, header.channels, header.sample, header.alpha, header.colour, reader.layout()),
            (whole.width, whole.height, whole.channels, whole.sample, whole.alpha, whole.colour, whole.layout),
            "the header of {source}",
        );
        let mut band = vec![7; 100];
        for rows in bands(whole.height, height, overlap).chain(bands(whole.height, height, overlap)) {
            reader.read(rows.clone(), &mut band).unwrap();
            assert!(band == cut(&whole, &rows), "{source}: rows {rows:?} in bands of {height}, {overlap} overlapping");
        }
    }
}

#[test]
fn every_fixture_is_read_by_bands() {
    let mut tested = 0;
    for entry in std::fs::read_dir(data("fixtures")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        let Some(name) = name.strip_suffix(".npy") else { continue };
        let (file, layer) = name.split_once('@').map_or((name, None), |(file, layer)| (file, Some(layer)));
        compare(&Source { path: Some(data("fixtures").join(file)), layer: layer.map(str::to_owned) }, &ReadOptions::default());
        tested += 1;
    }
    assert!(tested >= 40, "only {tested} fixtures were found");
}

#[test]
fn the_colour_space_that_is_asked_for_is_told() {
    let options = ReadOptions { colorspace: Some("acescg".parse().unwrap()), ..ReadOptions::default() };
    for name in ["rgba16.png", "layers.exr", "rgba8.tif", "grey.jpg"] {
        compare(&Source::file(data("fixtures").join(name)), &options);
    }
}

/// Every way to write a format: sample type, channels, compression.
fn ways(format: Format) -> Vec<WriteOptions> {
    let mut ways = Vec::new();
    for pixel_type in [Sample::U8, Sample::U16, Sample::F16, Sample::F32] {
        for channels in [Channels::Y, Channels::Ya, Channels::Rgb, Channels::Rgba] {
            let methods = Compression::of(format).iter().copied().map(Some);
            let methods: Vec<_> = if Compression::of(format).is_empty() { vec![None] } else { methods.collect() };
            for compression in methods {
                let options =
                    WriteOptions { pixel_type: Some(pixel_type), channels: Some(channels), compression, ..WriteOptions::default() };
                let form = output_form(&Target { path: None, format }, &options, None);
                if form.is_ok_and(|form| form.channels == channels) {
                    ways.push(options);
                }
            }
        }
    }
    ways
}

#[test]
fn every_format_is_written_by_bands_and_read_by_bands() {
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let path = folder.path().join(format!("picture.{}", format.name()));
        let target = Target { path: Some(path.clone()), format };
        for (index, options) in ways(format).into_iter().enumerate() {
            let whole = picture(format, HEIGHT, &options);
            let expected = encode(&target, &whole, &options).unwrap();
            // Each file is synced, so not every way is tried with every height.
            for height in [BANDS[index % 5], BANDS[(index + 2) % 5]] {
                let mut writer = RowWriter::create(&target, &whole, &options).unwrap();
                for rows in bands(HEIGHT, height, 0) {
                    writer.write(&cut(&whole, &rows)).unwrap();
                }
                writer.finish().unwrap();
                // A PNG that is written by rows has the same pixels, but its compressed stream is put together otherwise.
                if matches!(format, Format::Png | Format::Apng) {
                    assert!(read(&Source::file(&path), &ReadOptions::default()).unwrap().bytes == whole.bytes, "{options:?}");
                } else {
                    assert!(std::fs::read(&path).unwrap() == expected, "{format:?} {options:?} in bands of {height}");
                }
            }
            if options.channels != Some(Channels::Ya) {
                compare(&Source::file(&path), &ReadOptions::default());
            }
        }
    }
}

#[test]
fn a_picture_beyond_the_limits_is_read_by_bands() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = ReadOptions::default();
    options.limits.max_pixels = u64::from(WIDTH) * 40;
    for format in Format::ALL {
        let path = folder.path().join("picture");
        let whole = picture(format, HEIGHT, &WriteOptions::default());
        std::fs::write(&path, encode(&Target { path: None, format }, &whole, &WriteOptions::default()).unwrap()).unwrap();
        let error = read(&Source::file(&path), &options).unwrap_err();
        assert!(matches!(error, Error::TooLarge { .. }), "{error}");
        // An animated PNG of one picture is a PNG.
        let by_rows = format.by_rows() || format == Format::Apng;
        assert_eq!(error.to_string().contains("read it by bands of rows"), by_rows, "{error}");
        match RowReader::open(&Source::file(&path), &options) {
            Ok(mut reader) => {
                assert!(by_rows, "{format:?}");
                let mut band = Vec::new();
                reader.read(100..140, &mut band).unwrap();
                assert!(!band.is_empty());
                let error = reader.read(0..41, &mut band).unwrap_err().to_string();
                assert!(error.contains("ask for fewer rows"), "{error}");
            }
            Err(error) => assert!(!by_rows && error.to_string().contains("convert it to one of these"), "{error}"),
        }
    }
}

#[test]
fn a_thread_ahead_and_one_behind_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for format in [Format::Exr, Format::Png, Format::Jpeg] {
        let path = folder.path().join("picture");
        let target = Target { path: Some(path.clone()), format };
        let whole = picture(format, HEIGHT, &WriteOptions::default());
        let mut writer = RowWriter::create(&target, &whole, &WriteOptions::default()).unwrap().behind();
        for rows in bands(HEIGHT, 16, 0) {
            writer.write(cut(&whole, &rows)).unwrap();
        }
        writer.finish().unwrap();

        let expected = read(&Source::file(&path), &ReadOptions::default()).unwrap();
        let wanted: Vec<_> = bands(HEIGHT, 16, 5).collect();
        let mut ahead = RowReader::open(&Source::file(&path), &ReadOptions::default()).unwrap().ahead(wanted.clone());
        for rows in wanted {
            let band = ahead.next().unwrap().unwrap();
            assert!(band == cut(&expected, &rows), "{format:?}, rows {rows:?}");
            ahead.reuse(band);
        }
        assert!(ahead.next().is_none());
        // Nobody need ask for everything.
        drop(RowReader::open(&Source::file(&path), &ReadOptions::default()).unwrap().ahead(vec![0..9, 9..20, 20..30]));
    }
}

#[test]
fn errors_come_from_the_threads() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.exr");
    let target = Target { path: Some(path.clone()), format: Format::Exr };
    let whole = picture(Format::Exr, HEIGHT, &WriteOptions::default());
    let begin = || RowWriter::create(&target, &whole, &WriteOptions::default()).unwrap().behind();
    let mut writer = begin();
    // The second band tells what was wrong with the first, and the end that something was.
    let odd = (0..3).map(|_| writer.write(vec![0; 5])).find_map(Result::err).unwrap().to_string();
    assert!(odd.contains("5 bytes are not some of"), "{odd}");
    assert!(writer.finish().unwrap_err().to_string().contains("an earlier band"));
    assert!(begin().finish().unwrap_err().to_string().contains("it was to have"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);

    let bytes = encode(&target, &whole, &WriteOptions::default()).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
    let all: Vec<_> = bands(HEIGHT, 16, 0).collect();
    let outcomes: Vec<_> = RowReader::open(&Source::file(&path), &ReadOptions::default()).unwrap().ahead(all).collect();
    assert!(outcomes.len() > 2 && outcomes.last().unwrap().is_err() && outcomes[..outcomes.len() - 1].iter().all(Result::is_ok));
}

#[test]
fn what_cannot_be_written_by_rows_names_what_can() {
    let target = Target { path: None, format: Format::Jpeg };
    let form = output_form(&target, &WriteOptions::default(), None).unwrap();
    let like = form.picture(30_000, 30_000, Vec::new(), Metadata::default());
    let error = RowWriter::create(&target, &like, &WriteOptions::default()).unwrap_err().to_string();
    assert!(error.contains("JPEG is encoded whole") && error.contains("write EXR, PNG, TIFF, PFM or NPY"), "{error}");
}

#[test]
fn only_a_finished_file_appears() {
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let path = folder.path().join("picture");
        std::fs::write(&path, "old").unwrap();
        let target = Target { path: Some(path.clone()), format };
        let whole = picture(format, HEIGHT, &WriteOptions::default());
        let half = cut(&whole, &(0..HEIGHT / 2));

        let mut dropped = RowWriter::create(&target, &whole, &WriteOptions::default()).unwrap();
        dropped.write(&half).unwrap();
        drop(dropped);
        let mut short = RowWriter::create(&target, &whole, &WriteOptions::default()).unwrap();
        short.write(&half).unwrap();
        let error = short.finish().unwrap_err().to_string();
        assert!(error.contains("it was to have 147 rows and has 73"), "{error}");
        let mut long = RowWriter::create(&target, &whole, &WriteOptions::default()).unwrap();
        long.write(&half).unwrap();
        assert!(long.write(&cut(&whole, &(0..75))).is_err());
        assert!(long.write(&half[1..]).is_err());
        drop(long);

        assert_eq!(std::fs::read(&path).unwrap(), b"old", "{format:?}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{format:?} left something behind");
    }
}

#[test]
fn damaged_files_do_no_damage_by_bands() {
    let mut tested = 0;
    for entry in std::fs::read_dir(data("damaged")).unwrap() {
        let source = Source::file(entry.unwrap().path());
        attempt(&source, &ReadOptions::default());
        tested += 1;
    }
    assert_eq!(tested, 58);
    assert!(peak() < 1 << 20, "{} kB", peak());
}

/// Opens a file and reads some bands of it, which may fail.
fn attempt(source: &Source, options: &ReadOptions) {
    let read = || {
        let mut reader = RowReader::open(source, options)?;
        let height = reader.header().height;
        let mut band = Vec::new();
        let bands = [0..height.min(7), height / 2..(height / 2 + 20).min(height), height - height.min(5)..height, 0..height.min(64)];
        for rows in bands {
            reader.read(rows, &mut band)?;
        }
        Ok::<_, Error>(())
    };
    if let Err(error) = read() {
        assert!(error.to_string().contains(&source.to_string()), "{error}");
    }
}

#[test]
fn cut_and_changed_files_end_in_an_error_or_in_rows() {
    let mut state = 1_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize
    };
    let mut options = ReadOptions::default();
    options.limits.max_pixels = 1 << 20;
    options.limits.max_bytes = 1 << 24;
    let folder = tempfile::tempdir().unwrap();
    let source = Source::file(folder.path().join("changed"));
    for entry in std::fs::read_dir(data("fixtures")).unwrap() {
        let whole = std::fs::read(entry.unwrap().path()).unwrap();
        let changed = |bytes: &[u8]| {
            std::fs::write(source.path.as_ref().unwrap(), bytes).unwrap();
            attempt(&source, &options);
        };
        for _ in 0..8 {
            changed(&whole[..random() % whole.len()]);
            let mut bytes = whole.clone();
            let at = random() % bytes.len();
            bytes[at] = random() as u8;
            changed(&bytes);
            let mut bytes = whole.clone();
            let at = random() % bytes.len().min(400);
            bytes[at] = [0, 1, 0x7f, 0x80, 0xff][random() % 5];
            changed(&bytes);
        }
    }
}

/// The peak of this process in kB, where the system tells it.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    peak.and_then(|rest| rest.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0)
}

#[test]
fn lying_headers_cost_little() {
    let folder = tempfile::tempdir().unwrap();
    let huge = 100_000_u32;
    for format in [Format::Exr, Format::Png, Format::Tiff, Format::Pfm, Format::Npy] {
        let sizes = [&b"61"[..], &WIDTH.to_ne_bytes(), &(WIDTH - 1).to_ne_bytes(), &WIDTH.to_be_bytes()];
        let large = [&b"100000"[..], &huge.to_ne_bytes(), &(huge - 1).to_ne_bytes(), &huge.to_be_bytes()];
        // A square picture, so that one replacement makes both sides huge.
        for options in ways(format) {
            let small = picture(format, WIDTH, &options);
            let mut bytes = encode(&Target { path: None, format }, &small, &options).unwrap();
            let head = bytes.len().min(500);
            let tail = bytes.len().saturating_sub(400).max(head);
            let mut tail = bytes.split_off(tail);
            let body = bytes.split_off(head);
            for (size, large) in sizes.iter().zip(&large) {
                bytes = replace(&bytes, size, large);
                tail = replace(&tail, size, large);
            }
            let path = folder.path().join("lies");
            std::fs::write(&path, [bytes, body, tail].concat()).unwrap();
            attempt(&Source::file(&path), &ReadOptions::default());
        }
    }
    assert!(peak() < 1 << 20, "{} kB", peak());
}

fn replace(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut rest = bytes;
    while let Some(at) = rest.windows(from.len()).position(|window| window == from) {
        out.extend_from_slice(&rest[..at]);
        out.extend_from_slice(to);
        rest = &rest[at + from.len()..];
    }
    out.extend_from_slice(rest);
    out
}

/// Pictures of a gigapixel go to disk and come back within a gigabyte of memory, of which the test's own bands are a
/// good part. Takes about 2 GB of disk.
#[test]
#[ignore = "takes minutes without optimisation; run with --release"]
fn a_gigapixel_fits_in_a_gigabyte() {
    let mut peaks = Vec::new();
    for (format, sample) in [(Format::Exr, Sample::F16), (Format::Png, Sample::U8), (Format::Tiff, Sample::U8), (Format::Tiff, Sample::U16)]
    {
        gigapixel(format, sample);
        peaks.push((format, peak()));
    }
    assert!(peak() < 1 << 20, "kB: {peaks:?}");
}

fn gigapixel(format: Format, sample: Sample) {
    const SIDE: u32 = 32_768;
    const BAND: u32 = 256;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large");
    let target = Target { path: Some(path.clone()), format };
    let compression = (sample == Sample::U16).then_some(Compression::Deflate);
    let options = WriteOptions { pixel_type: Some(sample), channels: Some(Channels::Y), compression, ..WriteOptions::default() };
    let like = output_form(&target, &options, None).unwrap().picture(SIDE, SIDE, Vec::new(), Metadata::default());
    // Each row differs from the next; as halves, the values are positive and finite.
    let pixels = |rows: Range<u32>| -> Vec<u8> {
        let mut bytes = Vec::with_capacity(rows.len() * SIDE as usize * sample.bytes());
        for (y, x) in rows.flat_map(|y| (0..SIDE).map(move |x| (y, x))) {
            let value = 0x3800_u16 | ((x / 16 + y) & 0x7ff) as u16;
            bytes.extend_from_slice(&value.to_le_bytes()[..sample.bytes()]);
        }
        bytes
    };
    let mut writer = RowWriter::create(&target, &like, &options).unwrap();
    for rows in bands(SIDE, BAND, 0) {
        writer.write(&pixels(rows)).unwrap();
    }
    writer.finish().unwrap();

    let mut reader = RowReader::open(&Source::file(&path), &ReadOptions::default()).unwrap();
    let mut band = Vec::new();
    for rows in bands(SIDE, BAND, 24) {
        reader.read(rows.clone(), &mut band).unwrap();
        assert!(band == pixels(rows.clone()), "{format:?}, rows {rows:?}");
    }
}

#[cfg(unix)]
#[test]
fn what_cannot_seek_gets_the_same_file() {
    use std::io::Read;
    let folder = tempfile::tempdir().unwrap();
    for format in [Format::Exr, Format::Tiff, Format::Pfm, Format::Npy, Format::Qoi] {
        // A pipe with a name.
        let path = folder.path().join(format.name());
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let whole = picture(format, HEIGHT, &WriteOptions::default());
        let target = Target { path: Some(path.clone()), format };
        let expected = encode(&target, &whole, &WriteOptions::default()).unwrap();
        let reader = std::thread::spawn(move || {
            let mut bytes = Vec::new();
            std::fs::File::open(path).unwrap().read_to_end(&mut bytes).unwrap();
            bytes
        });
        let mut writer = RowWriter::create(&target, &whole, &WriteOptions::default()).unwrap();
        for rows in bands(HEIGHT, 16, 0) {
            writer.write(&cut(&whole, &rows)).unwrap();
        }
        writer.finish().unwrap();
        assert!(reader.join().unwrap() == expected, "{format:?}");
    }
}
