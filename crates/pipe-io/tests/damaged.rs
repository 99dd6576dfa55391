//! The damaged files of OpenEXR's regression set end in an error that names them, or in a picture; quickly, and in
//! little memory. (That nothing aborts is tested by this test's process still being there.)

#![allow(clippy::unwrap_used)] // a test may stop where it stands

use std::path::Path;
use std::time::{Duration, Instant};

use pipe_io::{ReadOptions, Source, probe, read};

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
