//! Every file of `data/fixtures` decodes to the values that stand beside it, which this crate had no part in making
//! (`make_fixtures.py`).

#![allow(clippy::unwrap_used)] // a test may stop where it stands

use std::path::{Path, PathBuf};

use pipe_io::{Channels, Colour, Input, ReadOptions, Sample, Source, Transfer, probe, read};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/fixtures")
}

/// The shape and values of a float32 `.npy`, read without this crate.
fn expectation(path: &Path) -> (usize, usize, usize, Vec<f32>) {
    let bytes = std::fs::read(path).unwrap();
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
    assert!(header.contains("'<f4'") && header.contains("'fortran_order': False"), "{header}");
    let shape = header.split(['(', ')']).nth(1).unwrap();
    let shape: Vec<usize> = shape.split(',').filter_map(|axis| axis.trim().parse().ok()).collect();
    let values = bytes[10 + length..].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    (shape[0], shape[1], shape[2], values.collect())
}

/// How far off a value may be: nothing for lossless formats.
fn tolerance(name: &str) -> f32 {
    match name {
        // Decoders differ in rounding the cosine transform and in upsampling.
        _ if Path::new(name).extension().is_some_and(|extension| extension == "jpg") => 2.5 / 255.0,
        // f32 here, f64 there.
        _ if name.starts_with("yc_") => 2e-5,
        _ => 0.0,
    }
}

#[test]
fn every_fixture_decodes_to_its_values() {
    let mut tested = 0;
    let mut entries: Vec<_> = std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries.iter().filter(|path| path.extension().is_some_and(|extension| extension == "npy")) {
        let name = path.file_stem().unwrap().to_str().unwrap();
        let (file, layer) = name.split_once('@').map_or((name, None), |(file, layer)| (file, Some(layer)));
        let source = Source { path: Some(folder().join(file)), layer: layer.map(str::to_owned) };
        let (height, width, channels, values) = expectation(path);
        let picture = read(&source, &ReadOptions::default()).unwrap();
        let header = probe(&source, &ReadOptions::default()).unwrap();
        let size = (picture.width as usize, picture.height as usize, picture.channels.count());
        assert_eq!(size, (width, height, channels), "{name}");
        assert_eq!(
            (header.width, header.height, header.channels, header.sample, header.alpha, header.colour),
            (picture.width, picture.height, picture.channels, picture.sample, picture.alpha, picture.colour),
            "the header of {name} announces something else",
        );
        for (index, want) in values.iter().enumerate() {
            let (pixel, channel) = (index / channels, index % channels);
            let (x, y) = ((pixel % width) as u32, (pixel / width) as u32);
            let got = picture.sample_at(x, y, channel).unwrap();
            assert!((got - want).abs() <= tolerance(name), "{name} at {x},{y}, channel {channel}: {got}, not {want}");
        }
        tested += 1;
    }
    assert!(tested >= 40, "only {tested} fixtures were found");
}

fn picture(name: &str) -> pipe_io::Picture {
    read(&Source::parse(folder().join(name).to_str().unwrap()), &ReadOptions::default()).unwrap()
}

#[test]
fn samples_keep_the_type_of_the_file() {
    for (name, sample) in [
        ("layers.exr", Sample::F16),
        ("layers.exr#Z", Sample::F32),
        ("layers.exr#ids", Sample::F32),
        ("none.exr", Sample::F32),
        ("interlaced.png", Sample::U8),
        ("rgba16.png", Sample::U16),
        ("half.tif", Sample::F16),
        ("planar.tif", Sample::F32),
        ("bright.hdr", Sample::F32),
    ] {
        assert_eq!(picture(name).sample, sample, "{name}");
    }
}

#[test]
fn colours_follow_the_format_and_the_file() {
    assert_eq!(picture("interlaced.png").colour, Colour::SRGB);
    assert_eq!(picture("linear.png").colour.transfer, Transfer::Linear);
    assert_eq!(picture("layers.exr").colour, Colour::LINEAR_REC709);
    let options = ReadOptions { colorspace: Some("acescg".parse().unwrap()), ..ReadOptions::default() };
    let forced = read(&Source::file(folder().join("interlaced.png")), &options).unwrap();
    assert_eq!(forced.colour.primaries, pipe_io::Primaries::ACESCG);
}

#[test]
fn headers_list_layers_and_attributes() {
    let header = |name: &str| probe(&Source::file(folder().join(name)), &ReadOptions::default()).unwrap();
    let layers = header("layers.exr");
    assert_eq!(layers.layers, ["", "diffuse", "ids", "motion"]);
    assert_eq!(layers.channel_names, ["R", "G", "B", "A"]);
    assert_eq!(layers.channels, Channels::Rgba);
    let attributes = layers.metadata.attributes.unwrap().list();
    for wanted in [("owner", "somebody"), ("custom", "kept"), ("xDensity", "72")] {
        assert!(attributes.iter().any(|(name, value)| (name.as_str(), value.as_str()) == wanted), "{attributes:?}");
    }
    assert_eq!(header("parts.exr").layers, ["depth", "beauty"]);
    let window = header("windows_overlap.exr").metadata.data_window.unwrap();
    assert_eq!((window.x, window.y, window.width, window.height), (5, 2, 13, 9));
}

#[test]
fn a_wrong_layer_lists_the_right_ones() {
    let source = Source { layer: Some("specular".to_owned()), ..Source::file(folder().join("layers.exr")) };
    let error = read(&source, &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("`specular`") && error.contains("`diffuse`"), "{error}");
    let source = Source { layer: Some("x".to_owned()), ..Source::file(folder().join("grey1.png")) };
    assert!(read(&source, &ReadOptions::default()).unwrap_err().to_string().contains("PNG"));
}

#[test]
fn limits_are_checked_before_decoding() {
    let mut options = ReadOptions::default();
    options.limits.max_pixels = 100;
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        // 4×3 pixels are below the limit, and a display window hides how large its data window is.
        if path.to_str().unwrap().contains("windows_") || path.extension().is_some_and(|extension| extension == "npy") {
            continue;
        }
        let error = probe(&Source::file(&path), &options).unwrap_err();
        assert!(matches!(error, pipe_io::Error::TooLarge { .. }), "{error}");
    }
}

#[test]
fn cut_and_flipped_files_end_in_an_error_or_a_picture() {
    // A cheap fuzz test, the same every time: every file cut short at several places, and with single bytes changed.
    let mut state = 1_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize
    };
    let mut options = ReadOptions::default();
    options.limits.max_pixels = 1 << 20;
    options.limits.max_bytes = 1 << 24;
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let whole = std::fs::read(&path).unwrap();
        let source = Source::file(&path);
        let attempt = |bytes: Vec<u8>| {
            if let Ok(input) = Input::from_bytes(&source, bytes, &options) {
                let _ = input.header();
                let _ = input.read();
            }
        };
        for _ in 0..12 {
            attempt(whole[..random() % whole.len()].to_vec());
            let mut changed = whole.clone();
            for _ in 0..=random() % 3 {
                let at = random() % changed.len();
                changed[at] = random() as u8;
            }
            attempt(changed);
            // Headers are where it hurts.
            let mut changed = whole.clone();
            let at = random() % changed.len().min(400);
            changed[at] = [0, 1, 0x7f, 0x80, 0xff][random() % 5];
            attempt(changed);
        }
    }
}
