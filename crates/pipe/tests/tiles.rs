//! Pictures that do not fit the budget go through tile by tile, and come out the same.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const BLUR: &str = r#"Graph(version: 1, inputs: {"in": Image}, outputs: {"out": "soft", "small": "hist"},
    nodes: {"soft": GaussianBlur(image: "in", sigma: 3), "hist": Histogram(image: "soft")})"#;

/// A folder with a picture `in.exr` and a graph `blur.ron` in it.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let photograph = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/workshop.exr");
    fs::copy(photograph, folder.path().join("in.exr")).expect("copied");
    fs::write(folder.path().join("blur.ron"), BLUR).expect("written");
    folder
}

fn pipe(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pipe"));
    command.args(arguments).current_dir(folder).env("XDG_CACHE_HOME", folder.join("cache")).output().expect("it starts")
}

#[track_caller]
fn succeeds(folder: &Path, arguments: &[&str]) {
    let output = pipe(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Every format, those that are written by rows and those that are not.
#[test]
fn every_format_in_tiles_is_what_it_is_whole() {
    let folder = folder();
    let folder = folder.path();
    for format in ["exr", "png", "tif", "pfm", "npy", "jpg", "webp", "hdr", "qoi"] {
        let (whole, tiled) = (format!("whole.{format}"), format!("tiled.{format}"));
        let small = ["-o", "small=counts.csv"];
        succeeds(folder, &[&["run", "blur.ron", "in.exr", &whole] as &[&str], &small].concat());
        let counts = fs::read(folder.join("counts.csv")).expect("read");
        let budget = ["--vram", "2MiB", "--stats", "stats.json"];
        succeeds(folder, &[&["run", "blur.ron", "in.exr", &tiled] as &[&str], &small, &budget].concat());
        let stats: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("stats.json")).expect("read")).expect("JSON");
        assert!(stats["peak_bytes"].as_u64().expect("a number") <= 2 << 20);
        succeeds(folder, &["compare", &whole, &tiled, "--fail", "0"]);
        assert_eq!(counts, fs::read(folder.join("counts.csv")).expect("read"), "{format}");
    }
    // And read back by rows, or whole where that is the only way.
    for format in ["png", "tif", "pfm", "npy", "jpg", "webp", "hdr", "qoi"] {
        let input = format!("whole.{format}");
        succeeds(folder, &["run", "tone-map", &input, "one.png"]);
        succeeds(folder, &["run", "tone-map", &input, "other.png", "--vram", "1MiB"]);
        succeeds(folder, &["compare", "one.png", "other.png", "--fail", "0"]);
    }
}

#[test]
fn frames_moving_pictures_and_streams_go_through_tiles() {
    let folder = folder();
    let folder = folder.path();
    for n in 1..=3 {
        fs::copy(folder.join("in.exr"), folder.join(format!("f.{n}.exr"))).expect("copied");
    }
    let budget = ["--vram", "1MiB"];
    succeeds(folder, &[&["run", "tone-map", "f.#.exr", "g.#.png", "--frames", "1-3"] as &[&str], &budget].concat());
    succeeds(folder, &[&["run", "tone-map", "f.#.exr", "g.apng", "--frames", "1-3"] as &[&str], &budget].concat());
    succeeds(folder, &["run", "tone-map", "in.exr", "whole.png"]);
    succeeds(folder, &["compare", "whole.png", "g.3.png", "--fail", "0"]);
    let output = pipe(folder, &[&["run", "tone-map", "in.exr", "-"] as &[&str], &budget].concat());
    assert!(output.status.success());
    fs::write(folder.join("stream.png"), output.stdout).expect("written");
    succeeds(folder, &["compare", "whole.png", "stream.png", "--fail", "0"]);
}

/// Rows that are wanted last come first in the file, and columns of a turned picture from all of it.
#[test]
fn files_are_read_in_the_order_that_turned_tiles_want() {
    let folder = folder();
    let folder = folder.path();
    let turned = r#"Graph(version: 1, inputs: {"in": Image}, outputs: {"turned": "t", "flipped": "f", "small": "s"},
        nodes: {"t": Rotate90(image: "in"), "c": Crop(image: "in", x: 100, y: 70, width: 301, height: 150), "f": Flip(image: "c"),
                "s": Resize(image: "in", scale: 0.4)})"#;
    fs::write(folder.join("turned.ron"), turned).expect("written");
    succeeds(folder, &["run", "blur.ron", "in.exr", "in.png", "-o", "small=counts.csv"]);
    succeeds(folder, &["run", "blur.ron", "in.exr", "in.tif", "-o", "small=counts.csv"]);
    let names = ["turned", "flipped", "small"];
    for input in ["in.exr", "in.png", "in.tif"] {
        let outputs = |of: &str| names.map(|name| ["-o".to_owned(), format!("{name}={of}-{name}.exr")]).concat();
        let run = |of: &str, more: &[&str]| {
            let outputs = outputs(of);
            let outputs: Vec<&str> = outputs.iter().map(String::as_str).collect();
            succeeds(folder, &[&["run", "turned.ron", "-i", &format!("in={input}")] as &[&str], &outputs, more].concat());
        };
        run("whole", &[]);
        run("tiled", &["--vram", "600KiB", "--force"]);
        for name in names {
            succeeds(folder, &["compare", &format!("whole-{name}.exr"), &format!("tiled-{name}.exr"), "--fail", "0"]);
        }
    }
}

/// What tiles cannot do is refused with the name of who needs it, before anything is written.
#[test]
fn what_does_not_fit_is_refused_by_name() {
    let folder = folder();
    let folder = folder.path();
    let turned = r#"Graph(version: 1, inputs: {"in": Image}, outputs: {"out": "b"},
        nodes: {"a": Exposure(image: "in", ev: 1), "turned": Transform(image: "a", rotate: 20), "b": GaussianBlur(image: "turned", sigma: 2)})"#;
    fs::write(folder.join("turned.ron"), turned).expect("written");
    fs::write(folder.join("out.png"), b"old").expect("written");
    let output = pipe(folder, &["run", "turned.ron", "in.exr", "out.png", "--vram", "1MiB"]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    for part in ["the budget is 1.0 MiB", "tiles do not help", "`turned`", "from anywhere"] {
        assert!(message.contains(part), "no `{part}` in {message}");
    }
    assert_eq!(fs::read(folder.join("out.png")).expect("read"), b"old");
    // A damaged file ends the run in its middle, and leaves nothing.
    let bytes = fs::read(folder.join("in.exr")).expect("read");
    let mut damaged = bytes.clone();
    let at = bytes.len() * 3 / 4;
    damaged[at..at + 4000].fill(0xff);
    fs::write(folder.join("damaged.exr"), damaged).expect("written");
    let output = pipe(folder, &["run", "tone-map", "damaged.exr", "out.png", "--vram", "1MiB"]);
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(fs::read(folder.join("out.png")).expect("read"), b"old");
    let mut names: Vec<_> = fs::read_dir(folder).expect("listed").map(|e| e.expect("read").file_name()).collect();
    names.sort();
    assert_eq!(names, ["blur.ron", "cache", "damaged.exr", "in.exr", "out.png", "turned.ron"]);
}
