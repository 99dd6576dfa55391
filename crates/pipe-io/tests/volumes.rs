//! Every file of `data/volumes` decodes to the values that stand beside it, which NumPy, nibabel and pynrrd made
//! (`make_volume_fixtures.py`); what is written reads back; damaged files end in a clear error.

#![allow(clippy::unwrap_used)] // a test may stop where it stands

use std::path::{Path, PathBuf};

use pipe_io::volume::{Volume, VolumeFormat, Voxel, probe, read, write};
use pipe_io::{Error, Limits, Source};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/volumes")
}

fn open(name: &str) -> Result<Volume, Error> {
    read(&Source::parse(&folder().join(name).to_string_lossy()), &Limits::default())
}

/// The shape (z, y, x, channels) and values of a float32 `.npy`, read without this crate.
fn expectation(path: &Path) -> ([usize; 4], Vec<f32>) {
    let bytes = std::fs::read(path).unwrap();
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
    assert!(header.contains("'<f4'") && header.contains("'fortran_order': False"), "{header}");
    let shape = header.split(['(', ')']).nth(1).unwrap();
    let shape: Vec<usize> = shape.split(',').filter_map(|axis| axis.trim().parse().ok()).collect();
    let values = bytes[10 + length..].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    (shape.try_into().unwrap(), values.collect())
}

#[test]
fn every_fixture_decodes_to_its_values() {
    let mut tested = 0;
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let Some(name) = path.file_name().unwrap().to_str().unwrap().strip_suffix(".expected.npy") else { continue };
        let source = name.replace('@', "#");
        let ([z, y, x, channels], expected) = expectation(&path);
        let volume = open(&source).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(volume.header.size.map(|n| n as usize), [x, y, z], "{name}");
        assert_eq!(usize::from(volume.header.channels), channels, "{name}");
        let header = probe(&Source::parse(&folder().join(&source).to_string_lossy()), &Limits::default()).unwrap();
        assert_eq!(header, volume.header, "{name}: the header of the beginning is that of the whole");
        for (i, (got, want)) in volume.values().iter().zip(&expected).enumerate() {
            assert!((got - want).abs() <= 1e-6 * want.abs().max(1.0), "{name}: value {i} is {got}, not {want}");
        }
        tested += 1;
    }
    assert_eq!(tested, 33, "a fixture has gone");
}

#[test]
fn spacing_is_read() {
    for name in ["i16.nrrd", "detached.nhdr", "i16.nii", "version2.nii.gz"] {
        let spacing = open(name).unwrap().header.spacing;
        let near = spacing.iter().zip([0.5, 1.0, 2.0]).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(near, "{name}: {spacing:?}");
    }
    assert_eq!(open("f32.nrrd").unwrap().header.spacing, [1.0; 3]);
}

#[test]
fn what_is_written_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let (size, spacing) = ([4, 3, 2], [0.5, 1.0, 2.0]);
    for channels in [1, 4] {
        let floats: Vec<f32> = (0..24 * usize::from(channels)).map(|i| i as f32 * 0.125 - 1.0).collect();
        for (name, voxel, tolerance) in [
            ("a.nrrd", Voxel::F32, 0.0),
            ("a.npy", Voxel::F32, 0.0),
            ("a.npy", Voxel::F16, 0.0),
            ("a.nrrd", Voxel::U16, 1.0 / 65535.0),
            ("a.raw", Voxel::F32, 0.0),
            ("a.raw", Voxel::U8, 0.5 / 255.0 + 1e-6),
        ] {
            let path = folder.path().join(name);
            write(&path, &Volume::of_floats(size, channels, spacing, &floats, voxel)).unwrap();
            let part = match (name, voxel) {
                ("a.raw", Voxel::U8) => format!("#4x3x2x{channels}:u8"),
                ("a.raw", _) => format!("#4x3x2x{channels}:f32"),
                _ => String::new(),
            };
            let back = read(&Source::parse(&format!("{}{part}", path.display())), &Limits::default()).unwrap();
            assert_eq!((back.header.size, back.header.channels, back.header.voxel), (size, channels, voxel), "{name}");
            for (got, want) in back.values().iter().zip(&floats) {
                let want = if matches!(voxel, Voxel::U8 | Voxel::U16) { want.clamp(0.0, 1.0) } else { *want };
                assert!((got - want).abs() <= tolerance, "{name} {voxel:?}: {got}, not {want}");
            }
            if back.header.format == VolumeFormat::Nrrd {
                assert_eq!(back.header.spacing, spacing);
            }
        }
    }
}

/// Reads these bytes as a file of this name.
fn attempt(name: &str, part: &str, bytes: &[u8]) -> Result<Volume, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&Source::parse(&format!("{}{part}", path.display())), &Limits::default())
}

#[test]
fn truncated_files_are_errors() {
    for name in ["u8.nrrd", "f32.nrrd", "f64.nrrd", "u16.nii.gz", "i16.nii", "version2.nii.gz", "c-order.npy", "fortran.npy"] {
        let whole = std::fs::read(folder().join(name)).unwrap();
        attempt(name, "", &whole).unwrap();
        for length in (0..whole.len() - 8).step_by(3) {
            let error = attempt(name, "", &whole[..length]).expect_err("a part of a file is no file");
            assert!(matches!(error, Error::Damaged { .. } | Error::UnknownFormat { .. } | Error::Unsupported { .. }), "{name}: {error}");
        }
    }
}

#[test]
fn flipped_bytes_never_panic() {
    for name in ["u8.nrrd", "f32.nrrd", "i16.nii", "version2.nii.gz", "channels.npy", "detached.nhdr"] {
        let whole = std::fs::read(folder().join(name)).unwrap();
        for at in 0..whole.len().min(400) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x55;
            // Whatever it reads as; a panic or an allocation of the declared size would end the test.
            let _ = attempt(name, "", &bytes);
        }
    }
}

#[test]
fn sizes_are_checked_before_anything_is_allocated() {
    let bomb = b"NRRD0004\ntype: float\ndimension: 3\nsizes: 100000 100000 100000\nendian: little\nencoding: gzip\n\n";
    let error = attempt("bomb.nrrd", "", bomb).unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }), "{error}");
    let overflow = b"NRRD0004\ntype: float\ndimension: 3\nsizes: 18446744073709551615 2 2\nendian: little\nencoding: raw\n\n";
    assert!(matches!(attempt("overflow.nrrd", "", overflow).unwrap_err(), Error::TooLarge { .. }));
    // Within the limit, but the file holds nothing of it.
    let empty = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2000 2000 2000\nencoding: raw\n\n";
    let error = attempt("empty.nrrd", "", empty).unwrap_err();
    assert!(error.to_string().contains("8000000000 bytes of voxels, but it has 0"), "{error}");
}

#[test]
fn mistakes_say_what_to_do() {
    let says = |result: Result<Volume, Error>, what: &str| {
        let text = result.expect_err("this is a mistake").to_string();
        assert!(text.contains(what), "{text}");
    };
    says(open("series.nii.gz"), "choose one as file.nii#0 to #2");
    says(open("series.nii.gz#3"), "points in time 0 to 2");
    says(open("be.raw"), "file.raw#WxHxD:TYPE");
    says(open("be.raw#5x4x4:u16be"), "ask for 160 bytes of voxels, but it has 120");
    says(open("be.raw#5x4x2:u16be"), "more than the 80");
    says(open("f32.nrrd#1"), "has no layer `1`");
    says(attempt("picture.nrrd", "", b"\x89PNG\r\n\x1a\n"), "is no volume this program knows");
    let gone = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: gone.raw\n";
    says(attempt("header.nhdr", "", gone), "gone.raw");
    let folder = tempfile::tempdir().unwrap();
    let half = Volume::of_floats([1, 1, 1], 1, [1.0; 3], &[0.0], Voxel::F16);
    assert!(write(&folder.path().join("a.nrrd"), &half).unwrap_err().to_string().contains("no half"));
    assert!(write(&folder.path().join("a.nii"), &half).unwrap_err().to_string().contains(".nrrd .npy .raw"));
}
