//! The damaged files of OpenEXR's regression set end in an error that names them, or in a picture; quickly, and in
//! little memory. (That nothing aborts is tested by this test's process still being there.)

#![allow(clippy::unwrap_used)] // a test may stop where it stands

use std::path::Path;
use std::time::{Duration, Instant};

use pipe_io::{Input, ReadOptions, Source, probe, read};

#[test]
fn damaged_files_do_no_damage() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/damaged");
    let mut tested = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.ends_with("LICENSE") {
            continue;
        }
        let source = Source::file(&path);
        let begun = Instant::now();
        let header = probe(&source, &ReadOptions::default());
        let outcome = read(&source, &ReadOptions::default());
        assert!(begun.elapsed() < Duration::from_secs(5), "{source} took {:?}", begun.elapsed());
        match outcome {
            Ok(picture) => assert!(header.is_ok() && !picture.bytes.is_empty()),
            Err(error) => assert!(error.to_string().contains(&source.to_string()), "{error}"),
        }
        tested += 1;
    }
    assert_eq!(tested, 57);
    // The peak of this process, in kB, where the system tells it.
    if let Ok(status) = std::fs::read_to_string("/proc/self/status") {
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let peak: u64 = peak.and_then(|rest| rest.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0);
        assert!(peak < 1 << 20, "{peak} kB");
    }
}

/// Wherever a JPEG breaks off, it is no picture; what follows its end does not matter.
#[test]
fn a_jpeg_is_whole_or_damaged() {
    for name in ["grey.jpg", "turned.jpg", "progressive.jpg"] {
        let whole = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/fixtures").join(name)).unwrap();
        let read = |bytes: Vec<u8>| Input::from_bytes(&Source::file(name), bytes, &ReadOptions::default())?.read();
        for length in 3..whole.len() {
            let error = read(whole[..length].to_vec()).expect_err(name).to_string();
            assert!(error.contains(name) && error.contains("is not a valid JPEG file"), "{length}: {error}");
        }
        let error = read(whole[..whole.len() - 2].to_vec()).unwrap_err().to_string();
        assert!(error.contains("it ends before its end marker"), "{error}");
        let picture = read(whole.clone()).unwrap();
        assert_eq!(read([whole, b"and a film".to_vec()].concat()).unwrap().bytes, picture.bytes);
    }
}
