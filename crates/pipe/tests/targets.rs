//! What a run is about to write: nothing that it reads, nothing twice, and a file for each frame.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

/// A folder with a picture `in.exr` in it, and as two frames.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let photograph = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/workshop.exr");
    for name in ["in.exr", "in.0001.exr", "in.0002.exr"] {
        fs::copy(&photograph, folder.path().join(name)).expect("copied");
    }
    folder
}

fn pipe(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pipe"));
    command.args(arguments).current_dir(folder).env("XDG_CACHE_HOME", folder.join("cache")).output().expect("it starts")
}

#[track_caller]
fn succeeds(folder: &Path, arguments: &[&str]) -> Output {
    let output = pipe(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Is refused with a message that says this, and everything is as it was.
#[track_caller]
fn refused(folder: &Path, arguments: &[&str], says: &str) {
    let before = content(folder);
    let output = pipe(folder, arguments);
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {text}");
    assert!(text.contains(says), "{arguments:?} does not say `{says}`: {text}");
    assert!(output.stdout.is_empty() && content(folder) == before, "{arguments:?} wrote something");
}

/// Every file with its bytes, the caches left out.
fn content(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder).expect("listed").map(|e| e.expect("read").path()).filter(|path| !path.ends_with("cache"));
    let mut files: Vec<_> = entries.map(|path| (path.display().to_string(), fs::read(&path).unwrap_or_default())).collect();
    files.sort();
    files
}

fn json(bytes: &[u8]) -> serde_json::Value {
    serde_json::from_slice(bytes).expect("JSON")
}

#[test]
fn no_frame_overwrites_an_input() {
    let folder = folder();
    let folder = folder.path();
    for (input, output) in [
        ("in.####.exr", "in.####.exr"),
        ("in.####.exr", "in.%04d.exr"),
        ("in.%04d.exr", "./in.####.exr"),
        ("in.0002.exr", "in.####.exr"),
        ("in.####.exr#R", "in.####.exr"),
    ] {
        refused(folder, &["run", "tone-map", input, output, "--frames", "1-2"], "--force");
    }
    refused(folder, &["run", "tone-map", "in.####.exr", "in.0002.exr", "--frames", "2"], "--force");
    refused(folder, &["run", "tone-map", "in.####.exr", "in.####.exr", "--frames", "1-4000000000"], "--force");
    // Other digits, other files.
    succeeds(folder, &["run", "tone-map", "in.####.exr", "in.###.exr", "--frames", "1-2"]);
    succeeds(folder, &["run", "tone-map", "in.####.exr", "in.####.exr", "--frames", "1-2", "--force"]);
}

#[cfg(unix)]
#[test]
fn a_link_to_an_input_is_the_input() {
    let folder = folder();
    let folder = folder.path();
    for frame in [1, 2] {
        std::os::unix::fs::symlink(format!("in.{frame:04}.exr"), folder.join(format!("out.{frame:04}.exr"))).expect("linked");
    }
    refused(folder, &["run", "tone-map", "in.####.exr", "out.####.exr", "--frames", "1-2"], "--force");
    refused(folder, &["run", "tone-map", "in.0001.exr", "out.0001.exr"], "--force");
    // A device holds nothing that could be lost.
    std::os::unix::fs::symlink("/dev/null", folder.join("null.exr")).expect("linked");
    succeeds(folder, &["run", "tone-map", "in.exr", "null.exr", "--dump", "mapped=null.exr", "--stats", "/dev/null"]);
}

#[test]
fn nothing_that_a_run_reads_is_overwritten() {
    let folder = folder();
    let folder = folder.path();
    let graph = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {
        "wall": ReadImage(path: "wall.exr"),
        "weights": ReadTable(path: "weights.json"),
        "both": Mix(a: "in", b: "wall"),
        "mean": PyramidAverage(image: "in"),
        "m": Readback(source: "mean", path: "mean.json"),
        "w": Readback(source: "weights", path: "weights.csv"),
    }, outputs: {"out": "both"})"#;
    fs::write(folder.join("graph.ron"), graph).expect("written");
    fs::write(folder.join("weights.json"), "[1.5, 2.5]").expect("written");
    fs::copy(folder.join("in.exr"), folder.join("wall.exr")).expect("copied");
    let run = |more: &[&'static str]| [&["run", "graph.ron"], more].concat();
    for (arguments, says) in [
        (run(&["in.exr", "wall.exr"]), "would overwrite wall.exr"),
        (run(&["in.exr", "out.exr", "--stats", "in.exr"]), "(--stats) would overwrite the input in.exr"),
        (run(&["in.exr", "out.exr", "--trace", "graph.ron"]), "(--trace) would overwrite graph.ron"),
        (run(&["in.exr", "out.exr", "--stats", "weights.json"]), "would overwrite weights.json"),
        (run(&["in.exr", "out.exr", "--dump", "both=in.exr"]), "(--dump both) would overwrite the input in.exr"),
        // What is written once is written twice.
        (run(&["in.exr", "out.exr", "--dump", "both=./out.exr"]), "would be one file"),
        (run(&["in.exr", "out.exr", "--stats", "mean.json"]), "would be one file"),
        (run(&["in.exr", "out.exr", "--stats", "s.json", "--trace", "s.json"]), "would be one file"),
        (run(&["in.exr", "-o", "out=a.exr", "-o", "out=b.exr"]), "the output `out` is given twice"),
        (run(&["-i", "in=in.exr", "-i", "in=wall.exr", "out.exr"]), "the input `in` is given twice"),
        (run(&["in.exr", "out.exr", "--dump", "both=a.exr", "--dump", "both=b.exr"]), "--dump both is given twice"),
        (run(&["in.exr", "-o", "out=-", "--stats", "-"]), "would both go to stdout"),
        (run(&["in.exr", "-o", "out=-", "--dump", "both=-.exr"]), "would both go to stdout"),
    ] {
        refused(folder, &arguments, says);
    }
    // A readback overwrites no input either.
    let graph = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {
        "crop": Crop(image: "in", x: 0, y: 0, width: 4, height: 4),
        "pixels": Readback(source: "crop", path: "pixels.npy"),
    }, outputs: {"out": "crop"})"#;
    fs::write(folder.join("pixels.ron"), graph).expect("written");
    succeeds(folder, &["run", "pixels.ron", "in.exr", "out.npy"]);
    refused(
        folder,
        &["run", "pixels.ron", "pixels.npy", "out.npy"],
        "the readback pixels.npy (`pixels`) would overwrite the input pixels.npy",
    );
    succeeds(folder, &run(&["in.exr", "wall.exr", "--force"]));
}

#[test]
fn a_comparison_overwrites_neither_image() {
    let folder = folder();
    let folder = folder.path();
    succeeds(folder, &["run", "tone-map", "in.exr", "other.exr"]);
    refused(folder, &["compare", "in.exr", "other.exr", "--diff", "./in.exr"], "would overwrite in.exr");
    refused(folder, &["compare", "in.exr", "other.exr", "--diff", "other.exr"], "would overwrite other.exr");
    refused(folder, &["compare", "in.exr", "other.exr", "--diff", "-"], "stdout has the numbers");
    for (flag, limit) in [("--fail", "nan"), ("--fail", "inf"), ("--fail-percent", "NaN"), ("--fail-percent=-1", "")] {
        let arguments = ["compare", "in.exr", "other.exr", flag, limit];
        refused(folder, &arguments[..if limit.is_empty() { 4 } else { 5 }], "expected 0 or more");
    }
    // As floats the difference is what it is.
    for name in ["d.exr", "d.hdr", "d.pfm", "d.npy", "d.tif", "d.gif"] {
        assert_eq!(pipe(folder, &["compare", "in.exr", "other.exr", "--diff", name]).status.code(), Some(1), "{name}");
    }
    let most = json(&pipe(folder, &["compare", "in.exr", "other.exr", "--json"]).stdout)["max_abs"].clone();
    let graph = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {
        "stats": Stats(image: "in"), "m": Readback(source: "stats.max"),
    })"#;
    fs::write(folder.join("max.ron"), graph).expect("written");
    succeeds(folder, &["run", "max.ron", "d.exr", "--stats", "s.json"]);
    assert_eq!(
        json(&fs::read(folder.join("s.json")).expect("read"))["readbacks"]["m"][0].as_f64().map(|v| v as f32),
        most.as_f64().map(|v| v as f32)
    );
}

#[test]
fn every_frame_has_files_of_its_own() {
    let folder = folder();
    let folder = folder.path();
    let frames = |more: &[&'static str]| [&["run", "tone-map", "in.####.exr", "out.##.png", "--frames", "1-2"], more].concat();
    refused(folder, &frames(&["--dump", "luma=luma.exr"]), "every frame would be written to luma.exr");
    refused(folder, &frames(&["--dump", "mapped=m.gif"]), "every frame would be written to m.gif");
    succeeds(folder, &frames(&["--dump", "luma=luma.#.exr", "--stats", "s.##.json", "--trace", "trace.json"]));
    for name in ["luma.1.exr", "luma.2.exr", "s.01.json", "s.02.json", "trace.json"] {
        assert!(folder.join(name).is_file(), "{name}");
    }
    assert_eq!(json(&fs::read(folder.join("s.01.json")).expect("read"))["size"], serde_json::json!([512, 256]));
    assert!(!folder.join("s.##.json").exists());
    // An empty file is no finished frame.
    fs::write(folder.join("out.01.png"), "").expect("written");
    fs::write(folder.join("out.02.png"), "finished").expect("written");
    succeeds(folder, &frames(&["--resume"]));
    assert!(fs::read(folder.join("out.01.png")).expect("read").starts_with(b"\x89PNG"));
    assert_eq!(fs::read(folder.join("out.02.png")).expect("read"), b"finished");
}
