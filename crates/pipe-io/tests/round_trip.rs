//! What is written reads back: bit for bit where the format is lossless, near where it is not.

#![allow(clippy::unwrap_used)] // a test may stop where it stands

use pipe_io::{
    Alpha, Channels, Colorspace, Colour, Compression, Format, Input, Layout, Metadata, Picture, ReadOptions, Sample, Source, Target,
    Transfer, WriteOptions, encode, output_form, write,
};

const WIDTH: u32 = 61;
const HEIGHT: u32 = 47;

/// A smooth picture with some noise in the form that a target wants, the same every time.
fn picture(target: &Target, options: &WriteOptions) -> Picture {
    let form = output_form(target, options, None).unwrap();
    let count = form.channels.count();
    let mut state = 7_u32;
    let mut bytes = Vec::new();
    for index in 0..(WIDTH * HEIGHT) as usize * count {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (state >> 16) as f32 / 65536.0;
        let value = (index as f32 / 1000.0).sin() * 0.4 + 0.5 + noise * 0.05;
        match form.sample {
            Sample::U8 => bytes.push((value * 255.0) as u8),
            Sample::U16 => bytes.extend(((value * 65535.0) as u16).to_ne_bytes()),
            Sample::F16 => bytes.extend(half::f16::from_f32(value * 3.0 - 1.0).to_ne_bytes()),
            Sample::F32 => bytes.extend((value * 3.0 - 1.0).to_ne_bytes()),
        }
    }
    form.picture(WIDTH, HEIGHT, bytes, Metadata::default())
}

fn target(format: Format) -> Target {
    Target { path: None, format }
}

fn round_trip(format: Format, options: &WriteOptions) -> (Picture, Picture) {
    let before = picture(&target(format), options);
    let bytes = encode(&target(format), &before, options).unwrap();
    let input = Input::from_bytes(&Source::file("memory"), bytes, &ReadOptions::default()).unwrap();
    assert_eq!(input.format(), format);
    let after = input.read().unwrap();
    (before, after)
}

fn same(format: Format, options: &WriteOptions) {
    let (before, after) = round_trip(format, options);
    let about = |p: &Picture| (p.width, p.height, p.sample, p.layout, p.channels, p.alpha);
    // NPY says nothing about alpha.
    assert_eq!(about(&before), about(&after), "{format:?} {options:?}");
    assert!(before.bytes == after.bytes, "{format:?} {options:?}: other bytes came back");
}

const ALL: [Channels; 4] = [Channels::Y, Channels::Ya, Channels::Rgb, Channels::Rgba];

fn options(pixel_type: Sample, channels: Channels, compression: Option<Compression>) -> WriteOptions {
    WriteOptions { pixel_type: Some(pixel_type), channels: Some(channels), compression, ..WriteOptions::default() }
}

#[test]
fn lossless_formats_keep_every_bit() {
    for channels in ALL {
        for &method in Compression::of(Format::Png) {
            same(Format::Png, &options(Sample::U8, channels, Some(method)));
            same(Format::Png, &options(Sample::U16, channels, Some(method)));
        }
        for &method in Compression::of(Format::Tiff) {
            for sample in [Sample::U8, Sample::U16, Sample::F32] {
                same(Format::Tiff, &options(sample, channels, Some(method)));
            }
        }
        for sample in [Sample::U8, Sample::U16, Sample::F16, Sample::F32] {
            if channels == Channels::Ya {
                // An array does not say that its second number is alpha.
                let (before, after) = round_trip(Format::Npy, &options(sample, channels, None));
                assert_eq!((after.channels, after.alpha), (Channels::Ya, Alpha::None));
                assert!(before.bytes == after.bytes, "{sample:?}");
            } else {
                same(Format::Npy, &options(sample, channels, None));
            }
        }
        same(Format::Qoi, &options(Sample::U8, channels, None));
        same(Format::Pfm, &options(Sample::F32, channels, None));
    }
    for channels in [Channels::Rgb, Channels::Rgba] {
        same(Format::WebP, &options(Sample::U8, channels, None));
    }
}

#[test]
fn exr_keeps_every_bit_where_it_is_lossless() {
    use Compression::{B44, B44a, None, Piz, Pxr24, Rle, Zip, Zips};
    for channels in ALL {
        for method in [None, Rle, Zips, Zip, Piz] {
            same(Format::Exr, &options(Sample::F16, channels, Some(method)));
            same(Format::Exr, &options(Sample::F32, channels, Some(method)));
        }
        same(Format::Exr, &options(Sample::F16, channels, Some(Pxr24)));
        same(Format::Exr, &options(Sample::F32, channels, Some(B44)));
        same(Format::Exr, &options(Sample::F32, channels, Some(B44a)));
    }
}

fn largest_difference(format: Format, options: &WriteOptions) -> f32 {
    let (before, after) = round_trip(format, options);
    assert_eq!((before.width, before.height, before.channels), (after.width, after.height, after.channels));
    let mut largest = 0.0_f32;
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            for channel in 0..before.channels.count() {
                let [a, b] = [&before, &after].map(|p| p.sample_at(x, y, channel).unwrap());
                largest = largest.max((a - b).abs());
            }
        }
    }
    largest
}

#[test]
fn lossy_formats_stay_near() {
    use Compression::{B44, B44a, Dwaa, Dwab, Pxr24};
    for channels in [Channels::Y, Channels::Rgb, Channels::Rgba] {
        for (sample, method, limit) in [
            (Sample::F32, Pxr24, 1e-4),
            (Sample::F16, B44, 0.15),
            (Sample::F16, B44a, 0.15),
            (Sample::F16, Dwaa, 0.3),
            (Sample::F16, Dwab, 0.3),
            (Sample::F32, Dwaa, 0.3),
        ] {
            let difference = largest_difference(Format::Exr, &options(sample, channels, Some(method)));
            assert!(difference < limit, "{channels:?} {sample:?} {method:?}: {difference}");
        }
    }
    let best = WriteOptions { quality: 100, ..options(Sample::U8, Channels::Y, None) };
    assert!(largest_difference(Format::Jpeg, &best) < 0.03);
}

#[test]
fn lying_counters_of_a_block_abort_nothing() {
    let options = options(Sample::F16, Channels::Rgb, Some(Compression::Dwaa));
    let good = encode(&target(Format::Exr), &picture(&target(Format::Exr), &options), &options).unwrap();
    // Two blocks of 32 lines: the table's first entry points just behind the table.
    let entry = |at: &usize| u64::from_le_bytes(*good[*at..].first_chunk().unwrap()) == *at as u64 + 16;
    let first_block = (8..good.len() - 8).find(entry).unwrap() + 16;
    for counter in 1..10 {
        let mut bad = good.clone();
        let at = first_block + 8 + counter * 8;
        bad[at..at + 8].copy_from_slice(&(u64::MAX >> 4).to_le_bytes());
        let input = Input::from_bytes(&Source::file("memory"), bad, &ReadOptions::default()).unwrap();
        assert!(input.read().is_err(), "counter {counter}");
    }
}

#[test]
fn radiance_keeps_eight_bits_of_mantissa() {
    let mut before = picture(&target(Format::Hdr), &WriteOptions::default());
    for value in before.bytes.as_chunks_mut::<4>().0 {
        *value = (f32::from_ne_bytes(*value) + 1.0).to_ne_bytes();
    }
    let bytes = encode(&target(Format::Hdr), &before, &WriteOptions::default()).unwrap();
    let after = Input::from_bytes(&Source::file("memory"), bytes, &ReadOptions::default()).unwrap().read().unwrap();
    for pixel in 0..(WIDTH * HEIGHT) {
        let (x, y) = (pixel % WIDTH, pixel / WIDTH);
        let [a, b] = [&before, &after].map(|p| [0, 1, 2].map(|c| p.sample_at(x, y, c).unwrap()));
        let brightest = a.iter().fold(0.0_f32, |m, &v| m.max(v));
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() <= brightest / 100.0, "{a} {b}");
        }
    }
}

#[test]
fn awkward_values_do_not_stop_a_writer() {
    let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, f32::MAX, f32::MIN_POSITIVE, 1e-45, 1.0];
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    for format in [Format::Hdr, Format::Pfm, Format::Tiff, Format::Npy, Format::Exr] {
        let options = options(Sample::F32, Channels::Rgb, None);
        let form = output_form(&target(format), &options, None).unwrap();
        let before = form.picture(3, 1, bytes.clone(), Metadata::default());
        let written = encode(&target(format), &before, &options).unwrap();
        let after = Input::from_bytes(&Source::file("memory"), written, &ReadOptions::default()).unwrap();
        let after = after.read().unwrap();
        if format != Format::Hdr {
            assert!(after.bytes == bytes, "{format:?}");
        }
    }
}

#[test]
fn one_pixel_and_thin_pictures_fit_everywhere() {
    for format in Format::ALL {
        for (width, height) in [(1, 1), (1, 5), (5, 1), (17, 33)] {
            let form = output_form(&target(format), &WriteOptions::default(), None).unwrap();
            let size = Picture::byte_count(width, height, form.channels, form.sample).unwrap();
            let before = form.picture(width, height, vec![0; size], Metadata::default());
            let bytes = encode(&target(format), &before, &WriteOptions::default()).unwrap();
            let after = Input::from_bytes(&Source::file("memory"), bytes, &ReadOptions::default()).unwrap();
            let after = after.read().unwrap();
            assert_eq!((after.width, after.height), (width, height), "{format:?}");
        }
    }
}

#[test]
fn attributes_and_chromaticities_pass_through() {
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/fixtures/layers.exr");
    let first = pipe_io::read(&Source::file(fixture), &ReadOptions::default()).unwrap();
    let options = WriteOptions { colorspace: Some(Colorspace::AcesCg), ..WriteOptions::default() };
    let form = output_form(&target(Format::Exr), &options, Some(&first.metadata)).unwrap();
    assert_eq!((form.sample, form.channels), (Sample::F16, Channels::Rgba));
    let picture = form.picture(first.width, first.height, first.bytes.clone(), first.metadata.clone());
    let bytes = encode(&target(Format::Exr), &picture, &options).unwrap();
    assert_eq!(bytes, encode(&target(Format::Exr), &picture, &options).unwrap(), "the same picture, another file");
    let again = Input::from_bytes(&Source::file("memory"), bytes, &ReadOptions::default()).unwrap().read().unwrap();
    assert_eq!(again.colour, Colorspace::AcesCg.colour());
    assert_eq!(again.metadata.attributes, first.metadata.attributes);
}

#[test]
fn colours_are_tagged_where_the_format_can() {
    let wide = WriteOptions { colorspace: Some(Colorspace::Rec2020Linear), ..WriteOptions::default() };
    let (_, after) = round_trip(Format::Png, &wide);
    assert_eq!(after.colour, Colorspace::Rec2020Linear.colour());
    assert_eq!(round_trip(Format::Png, &WriteOptions::default()).1.colour, Colour::SRGB);
    let linear = WriteOptions { colorspace: Some(Colorspace::LinearRec709), ..WriteOptions::default() };
    assert_eq!(round_trip(Format::Qoi, &linear).1.colour.transfer, Transfer::Linear);
}

#[test]
fn files_appear_whole_and_mistakes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.png");
    let target = Target::parse(path.to_str().unwrap()).unwrap();
    let good = picture(&target, &WriteOptions::default());
    write(&target, &good, &WriteOptions::default()).unwrap();
    let back = pipe_io::read(&Source::file(&path), &ReadOptions::default()).unwrap();
    assert_eq!(back.bytes, good.bytes);

    let short = Picture { bytes: vec![0; 7], ..good.clone() };
    assert!(write(&target, &short, &WriteOptions::default()).is_err());
    let planar = Picture { layout: Layout::Planar, ..good.clone() };
    assert!(write(&target, &planar, &WriteOptions::default()).is_err());
    let missing = Target::parse(folder.path().join("no/out.png").to_str().unwrap()).unwrap();
    let error = write(&missing, &good, &WriteOptions::default()).unwrap_err().to_string();
    assert!(error.contains("create its folder first"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "something was left behind");
    assert_eq!(good.alpha, Alpha::None);
}
