//! The program as a user runs it: exit codes, files that stay whole, sequences, streams.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use tempfile::TempDir;

const OLD: &[u8] = b"what was here before";

/// A folder with a picture `in.exr` in it.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("in.exr"), fs::read(photograph()).expect("read")).expect("written");
    folder
}

fn photograph() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/workshop.exr")
}

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pipe"));
    command.args(arguments).current_dir(folder).env("XDG_CACHE_HOME", folder.join("cache"));
    command
}

fn pipe(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().expect("it starts")
}

fn message(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[track_caller]
fn succeeds(folder: &Path, arguments: &[&str]) -> Output {
    let output = pipe(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", message(&output));
    output
}

/// Fails with this exit code and a message that says this.
#[track_caller]
fn fails(folder: &Path, arguments: &[&str], code: i32, says: &str) {
    let output = pipe(folder, arguments);
    let text = message(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    assert!(text.contains(says), "{arguments:?} does not say `{says}`: {text}");
    assert!(output.stdout.is_empty(), "{arguments:?} writes to stdout");
}

/// Names of the files in a folder, the caches left out.
fn files(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).expect("listed").map(|e| e.expect("read").file_name().to_string_lossy().into_owned());
    let mut names: Vec<_> = names.filter(|n| n != "cache").collect();
    names.sort();
    names
}

fn is_whole_png(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n") && bytes.ends_with(b"IEND\xaeB`\x82")
}

#[test]
fn what_works_says_nothing() {
    let folder = folder();
    // As in a container, where no one has a session.
    let output =
        command(folder.path(), &["run", "tone-map", "in.exr", "out.png"]).env_remove("XDG_RUNTIME_DIR").output().expect("it starts");
    assert!(output.status.success() && output.stdout.is_empty() && message(&output).is_empty(), "{}", message(&output));
}

#[test]
fn a_wrong_graph_or_command_line_is_1_and_a_wrong_world_is_2() {
    let folder = folder();
    let folder = folder.path();
    fs::write(folder.join("out.png"), OLD).expect("written");
    fs::write(folder.join("broken.exr"), &fs::read(photograph()).expect("read")[..5000]).expect("written");
    fs::write(folder.join("wrong.ron"), "Graph(version: 1, nodes: {\"a\": Blurr()}, outputs: {\"out\": \"a\"})").expect("written");
    for (arguments, code, says) in [
        (&["bogus"] as &[&str], 1, "unrecognized subcommand"),
        (&["run", "tone-map"], 1, "-i NAME=FILE"),
        (&["run", "tone-map", "in.exr"], 1, "no file is bound to the output"),
        (&["run", "tone-map", "in.exr", "out.png", "--set", "key=9"], 1, "expected 0.01 to 1"),
        (&["run", "tone-map", "in.exr", "out.png", "--set", "keyy=0.2"], 1, "there is no such parameter"),
        (&["run", "tone-map", "in.exr", "out.xyz"], 1, "cannot tell the format"),
        (&["run", "tone-map", "in.exr", "-o", "else=out.png"], 1, "the graph has no output `else`"),
        (&["run", "tone-map", "in.exr", "out.png", "--frames", "9-"], 1, "9-"),
        (&["run", "wrong.ron", "out.png"], 1, "there is no node kind `Blurr`"),
        (&["run", "tone-map", "in.####.exr", "out.####.png"], 1, "--frames A-B"),
        (&["run", "tone-map", "in.exr", "out.png", "--timeout", "0"], 1, "expected 1 second or more"),
        (&["plan", "tone-map", "--after", "fuse", "--svg"], 1, "--svg shows a whole plan"),
        (&["plan", "tone-map", "--after", "fusion"], 1, "lower, prune, fuse, schedule or allocate"),
        (&["run", "tone-map", "none.exr", "out.png"], 2, "cannot read `none.exr`"),
        (&["run", "tone-map", "in.exr", "out.png", "--max-pixels", "10"], 2, "512×256 pixels"),
        (&["run", "tone-map", "in.exr", "out.png", "--max-pixels", "1000"], 2, "more than the limit of 1000 (--max-pixels)"),
        (&["run", "tone-map", "broken.exr", "out.png"], 2, "is not a valid EXR file"),
        (&["run", "tone-map", "in.exr", "none/out.png"], 2, "create its folder first"),
        (&["run", "tone-map", "in.exr", "out.png", "--device", "no such"], 2, "no device fits"),
        (&["run", "tone-map", "in.exr", "out.png", "--vram", "1KiB"], 2, "tiles do not help"),
        (&["run", "nothing", "in.exr", "out.png"], 2, "pipe presets"),
    ] {
        fails(folder, arguments, code, says);
    }
    assert_eq!(fs::read(folder.join("out.png")).expect("read"), OLD, "a failed run touched the old output");
    assert_eq!(files(folder), ["broken.exr", "in.exr", "out.png", "wrong.ron"]);
}

#[test]
fn an_input_is_overwritten_only_by_force() {
    let folder = folder();
    let folder = folder.path();
    let before = fs::read(folder.join("in.exr")).expect("read");
    fails(folder, &["run", "tone-map", "in.exr", "./in.exr"], 1, "--force");
    assert_eq!(fs::read(folder.join("in.exr")).expect("read"), before);
    succeeds(folder, &["run", "tone-map", "in.exr", "in.exr", "--force"]);
    assert_ne!(fs::read(folder.join("in.exr")).expect("read"), before);
}

/// Mesa's software renderer ends a thread without a word after 65,535 rounds, a GPU would hang.
#[test]
fn a_shader_that_loops_for_ever_ends_in_an_error() {
    let folder = folder();
    let graph = |access: &str| {
        format!(
            r#"Graph(version: 1, inputs: {{"in": Image}}, nodes: {{"glow": Wgsl(shader: "glow.wgsl", inputs: {{"image": "in"}},
               outputs: {{"out": Image(like: "image")}}, access: {access})}}, outputs: {{"out": "glow"}})"#
        )
    };
    let shader = |rounds: &str| {
        format!("var v = 0.0; for (var i = 0; {rounds}; i++) {{ v += 1.0; while v > 1e9 {{ v *= 0.5; }} }} return vec4f(v);")
    };
    let write = |access: &str, text: String| {
        fs::write(folder.path().join("glow.ron"), graph(access)).expect("written");
        fs::write(folder.path().join("glow.wgsl"), text).expect("written");
    };
    for (access, function) in [("Point", "fn apply(image: vec4f) -> vec4f"), ("Around(1)", "fn at(xy: vec2i) -> vec4f")] {
        write(access, format!("{function} {{ {} }}", shader("v >= 0.0")));
        fails(folder.path(), &["run", "glow.ron", "in.exr", "out.exr"], 2, "the loops in the shader of `");
        assert!(!files(folder.path()).contains(&"out.exr".to_owned()));
        write(access, format!("{function} {{ {} }}", shader("i < 10000")));
        succeeds(folder.path(), &["run", "glow.ron", "in.exr", "out.exr", "--vram", "256KiB"]);
        fs::remove_file(folder.path().join("out.exr")).expect("it was written");
    }
}

/// What never ends is not read to its end.
#[cfg(unix)]
#[test]
fn a_device_is_neither_graph_nor_picture() {
    let folder = folder();
    let folder = folder.path();
    for (node, says) in [
        ("Subgraph(file: \"/dev/zero\")", "has more than 1048576 bytes"),
        ("Wgsl(shader: \"/dev/zero\", outputs: {\"out\": Image(size: (2, 2))})", "has more than 16777216 bytes"),
        ("ReadImage(path: \"/dev/zero\")", "is not a file or a pipe: it is a device"),
        ("ReadVolume(path: \"/dev/zero\")", "is not a file or a pipe: it is a device"),
    ] {
        let graph = format!("Graph(version: 1, nodes: {{\"a\": {node}}}, outputs: {{\"out\": \"a\"}})");
        fs::write(folder.join("graph.ron"), graph).expect("written");
        fails(folder, &["check", "graph.ron"], 1, says);
    }
    fails(folder, &["check", "/dev/zero"], 1, "expected at most 1048576 bytes");
    fails(folder, &["run", "tone-map", "/dev/zero", "out.png"], 1, "is not a file or a pipe: it is a device");
    // A pipe is read once, to its end.
    let mut child = command(folder, &["run", "tone-map", "/dev/stdin", "out.png"]).stdin(Stdio::piped()).spawn().expect("it starts");
    child.stdin.take().expect("piped").write_all(&fs::read(folder.join("in.exr")).expect("read")).expect("taken");
    assert!(child.wait().expect("it ends").success());
}

#[test]
fn streams_carry_pictures() {
    let folder = folder();
    let folder = folder.path();
    succeeds(folder, &["run", "tone-map", "in.exr", "file.png"]);
    let mut child = command(folder, &["run", "tone-map", "-", "-o", "out=-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let bytes = fs::read(folder.join("in.exr")).expect("read");
    child.stdin.take().expect("piped").write_all(&bytes).expect("taken");
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success(), "{}", message(&output));
    assert!(output.stdout == fs::read(folder.join("file.png")).expect("read"), "the stream differs from the file");
}

#[test]
fn frames_are_skipped_and_resumed() {
    let folder = folder();
    let folder = folder.path();
    for frame in [1, 2, 3, 5] {
        fs::copy(folder.join("in.exr"), folder.join(format!("in.{frame:04}.exr"))).expect("copied");
    }
    fs::write(folder.join("in.0003.exr"), "no picture").expect("written");
    let sequence = ["run", "tone-map", "in.####.exr", "out.%04d.png", "--frames", "1-5"];
    fails(folder, &sequence, 2, "frame 3");
    let with = |more: &[&'static str]| [&sequence, more].concat();
    let output = succeeds(folder, &with(&["--skip-bad-frames"]));
    assert!(message(&output).contains("frame 3 is skipped") && message(&output).contains("frame 4 is skipped"), "{}", message(&output));
    let written = |n: u32| folder.join(format!("out.{n:04}.png"));
    let whole = |n: u32| fs::read(written(n)).is_ok_and(|bytes| is_whole_png(&bytes));
    assert_eq!((1..=5).filter(|n| whole(*n)).collect::<Vec<_>>(), [1, 2, 5]);

    fs::write(written(1), OLD).expect("written");
    fs::remove_file(written(2)).expect("removed");
    succeeds(folder, &with(&["--skip-bad-frames", "--resume"]));
    assert_eq!(fs::read(written(1)).expect("read"), OLD, "a finished frame was written again");
    assert!(whole(2) && whole(5));
    let steps = succeeds(folder, &["run", "tone-map", "in.####.exr", "step.####.png", "--frames", "1-5x4"]);
    assert!(message(&steps).contains("2 frames written"), "{}", message(&steps));
}

#[test]
fn statistics_say_what_was_read_back() {
    let folder = folder();
    let folder = folder.path();
    let graph = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {
        "mean": PyramidAverage(image: "in"),
        "hist": Histogram(image: "in", bins: 4, range: (0, 1)),
        "m": Readback(source: "mean", path: "mean.json"),
        "h": Readback(source: "hist", path: "hist.csv"),
        "part": Subgraph(file: "part.ron", inputs: {"in": "in"}, options: (readback: "part.json")),
    })"#;
    fs::write(folder.join("graph.ron"), graph).expect("written");
    let part = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {"mean": PyramidAverage(image: "in")}, outputs: {"out": "mean"})"#;
    fs::write(folder.join("part.ron"), part).expect("written");
    succeeds(folder, &["run", "graph.ron", "in.exr", "--stats", "stats.json"]);
    let stats: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("stats.json")).expect("read")).expect("JSON");
    let counts = stats["readbacks"]["h"].as_array().expect("a table").iter().filter_map(serde_json::Value::as_u64);
    assert_eq!(counts.sum::<u64>(), 512 * 256);
    assert_eq!(stats["readbacks"]["m"].as_array().map(Vec::len), Some(4));
    let mean: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("mean.json")).expect("read")).expect("JSON");
    assert_eq!(mean, stats["readbacks"]["m"]);
    assert_eq!(mean, stats["readbacks"]["part"]);
    assert_eq!(fs::read(folder.join("part.json")).expect("read"), fs::read(folder.join("mean.json")).expect("read"));
    assert!(fs::read_to_string(folder.join("hist.csv")).expect("read").lines().count() >= 4);
}

#[test]
fn reports_on_stdout_are_json() {
    let folder = folder();
    let folder = folder.path();
    let json = |arguments: &[&str]| -> serde_json::Value {
        let output = succeeds(folder, arguments);
        serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{arguments:?}: {e}"))
    };
    let plan = json(&["plan", "tone-map", "--size", "640x480", "--json"]);
    for key in ["graph", "size", "passes", "slots", "peak_bytes", "naive_bytes", "bytes_moved"] {
        assert!(!plan[key].is_null(), "plan has no {key}");
    }
    assert_eq!(plan["size"], serde_json::json!([640, 480]));
    assert_eq!(json(&["plan", "tone-map", "--size", "640x480", "--after", "allocate", "--json"]), plan);
    let fused = json(&["plan", "tone-map", "--after", "fuse", "--json"]);
    assert_eq!((&fused["phase"], fused["passes"].as_array().map(Vec::len)), (&serde_json::json!("fuse"), Some(3)));
    assert!(fused["decisions"].to_string().contains("is computed inside"), "{fused}");
    let preset = json(&["presets", "tone-map", "--json"]);
    assert_eq!(preset["name"], "tone-map");
    assert!(preset["text"].as_str().is_some_and(|text| text.contains("Graph(")), "{preset}");
    let compared = json(&["compare", "in.exr", "in.exr", "--json"]);
    for key in ["max_abs", "mean_abs", "rms", "flip_mean", "different_percent"] {
        assert_eq!(compared[key].as_f64(), Some(0.0), "compare says {key} = {}", compared[key]);
    }
    let bench = json(&["bench", "tone-map", "--size", "64x64", "--runs", "1", "--json"]);
    for key in ["device", "copy_gb_s", "size", "nodes", "gpu_ms", "wall_ms"] {
        assert!(!bench[key].is_null(), "bench has no {key}");
    }
    assert!(json(&["devices", "--json"]).to_string().contains("name"));
    assert!(json(&["nodes", "BlurH", "--json"]).to_string().contains("sigma"));
    json(&["check", "tone-map", "--json"]);
    json(&["info", "tone-map", "--json"]);
}

#[test]
fn compare_fails_beyond_its_limits() {
    let folder = folder();
    let folder = folder.path();
    succeeds(folder, &["run", "tone-map", "in.exr", "a.png"]);
    succeeds(folder, &["run", "tone-map", "in.exr", "b.png", "--set", "key=0.2"]);
    assert_eq!(pipe(folder, &["compare", "a.png", "b.png", "--diff", "d.png"]).status.code(), Some(1));
    assert!(is_whole_png(&fs::read(folder.join("d.png")).expect("read")));
    succeeds(folder, &["compare", "a.png", "b.png", "--fail", "1"]);
}

/// A killed run leaves the old output or the new one, whole, and nothing else.
#[cfg(unix)]
#[test]
fn a_killed_run_leaves_no_half_file() {
    let folder = folder();
    let folder = folder.path();
    let arguments = ["run", "bloom", "in.exr", "out.exr"];
    succeeds(folder, &arguments);
    let new = fs::read(folder.join("out.exr")).expect("read");
    for after in (0..400).step_by(23) {
        fs::write(folder.join("out.exr"), OLD).expect("written");
        let mut child = command(folder, &arguments).stderr(Stdio::null()).spawn().expect("it starts");
        std::thread::sleep(Duration::from_millis(after));
        child.kill().expect("killed");
        child.wait().expect("it ends");
        let now = fs::read(folder.join("out.exr")).expect("read");
        assert!(now == OLD || now == new, "killed after {after} ms: {} bytes", now.len());
        if cfg!(target_os = "linux") {
            assert_eq!(files(folder), ["in.exr", "out.exr"], "killed after {after} ms");
        }
    }
}

/// Ctrl-C ends a run with 130 and leaves the old output.
#[cfg(unix)]
#[test]
fn an_interrupted_run_is_130() {
    let folder = folder();
    let folder = folder.path();
    let graph = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {
        "heat": HeatDiffusion(image: "in", steps: 1000000)}, outputs: {"out": "heat"})"#;
    fs::write(folder.join("long.ron"), graph).expect("written");
    fs::write(folder.join("out.exr"), OLD).expect("written");
    let mut child = command(folder, &["run", "long.ron", "in.exr", "out.exr"]).stderr(Stdio::null()).spawn().expect("it starts");
    std::thread::sleep(Duration::from_millis(1500));
    let interrupted = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill is there");
    assert!(interrupted.success());
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    assert_eq!(fs::read(folder.join("out.exr")).expect("read"), OLD);
}

/// `check`, `plan`, `info` and `nodes` work where there is no Vulkan driver.
#[cfg(target_os = "linux")]
#[test]
fn planning_needs_no_driver() {
    let folder = folder();
    let folder = folder.path();
    let without = |arguments: &[&str]| {
        let mut command = command(folder, arguments);
        command.env("VK_DRIVER_FILES", "/nonexistent.json").env("VK_ICD_FILENAMES", "/nonexistent.json");
        command.output().expect("it starts")
    };
    for arguments in
        [&["check", "bloom"] as &[&str], &["plan", "bloom", "--size", "1920x1080"], &["info", "bloom"], &["nodes"], &["presets"]]
    {
        let output = without(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", message(&output));
    }
    let output = without(&["run", "tone-map", "in.exr", "out.png"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(message(&output).contains("mesa-vulkan-drivers"), "{}", message(&output));
}

#[test]
fn frames_become_one_moving_picture() {
    let folder = folder();
    let folder = folder.path();
    let graph = r#"Graph(version: 1, nodes: {
        "plate": ZonePlate(size: (48, 32)),
        "moved": Offset(image: "plate", x: "=frame"),
    }, outputs: {"out": "moved"})"#;
    fs::write(folder.join("moving.ron"), graph).expect("written");
    for file in ["moving.apng", "moving.gif"] {
        succeeds(folder, &["run", "moving.ron", file, "--frames", "1-5", "--fps", "10"]);
    }
    let chunks = |name: &[u8; 4]| {
        let bytes = fs::read(folder.join("moving.apng")).expect("read");
        bytes.windows(4).filter(|w| w == name).count()
    };
    assert_eq!((chunks(b"acTL"), chunks(b"fcTL"), chunks(b"IEND")), (1, 5, 1));
    let gif = fs::read(folder.join("moving.gif")).expect("read");
    assert!(gif.starts_with(b"GIF89a") && gif.ends_with(b";"));
    succeeds(folder, &["compare", "moving.gif", "moving.apng", "--fail", "0.1"]);
    fails(folder, &["run", "moving.ron", "still.png", "--frames", "1-5"], 1, "out.apng");
    fails(folder, &["run", "moving.ron", "again.apng", "--frames", "1-5", "--resume"], 1, "--resume");
}

#[test]
fn every_frame_has_its_readbacks() {
    let folder = folder();
    let folder = folder.path();
    let graph = r#"Graph(version: 1, nodes: {
        "grey": Constant(color: "=frame", size: 1, options: (readback: "option.%02d.json")),
        "many": Readback(source: "grey", path: "many.####.json", channels: "r"),
        "one": Readback(source: "grey", path: "one.json", channels: "r"),
    })"#;
    fs::write(folder.join("counted.ron"), graph).expect("written");
    succeeds(folder, &["run", "counted.ron", "--frames", "7-8"]);
    let text = |name: &str| fs::read_to_string(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert_eq!(["many.0007.json", "many.0008.json", "one.json"].map(text), ["[[7.0]]\n", "[[8.0]]\n", "[[8.0]]\n"]);
    assert_eq!(["option.07.json", "option.08.json", "many.####.json"].map(|name| folder.join(name).exists()), [true, true, false]);
}

#[test]
fn frames_that_need_each_other_are_not_resumed() {
    let folder = folder();
    let folder = folder.path();
    let graph = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {
        "trail": Feedback(init: "in", next: "mixed"),
        "mixed": Mix(a: "in", b: "trail"),
    }, outputs: {"out": "mixed"})"#;
    fs::write(folder.join("trail.ron"), graph).expect("written");
    let outer = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {"t": Subgraph(file: "trail.ron", inputs: {"in": "in"})}, outputs: {"out": "t"})"#;
    fs::write(folder.join("outer.ron"), outer).expect("written");
    for graph in ["trail.ron", "outer.ron"] {
        fails(folder, &["run", graph, "in.exr", "out.####.png", "--frames", "1-3", "--resume"], 1, "without --resume");
        succeeds(folder, &["run", graph, "in.exr", "out.####.png", "--frames", "1-3"]);
    }
}

#[test]
fn a_window_of_a_scan_is_0_to_1() {
    let folder = folder();
    let folder = folder.path();
    let voxels: Vec<u8> = [-1000_i16, 0, 100, 300, 3000, 200].iter().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(folder.join("scan.raw"), voxels).expect("written");
    let graph = r##"Graph(version: 1, nodes: {
        "scan": ReadVolume(path: "scan.raw#6x1x1:i16", window: (0, 400)),
        "slice": VolumeSlice(volume: "scan"),
        "r": Readback(source: "slice", path: "slice.json"),
    })"##;
    fs::write(folder.join("scan.ron"), graph).expect("written");
    succeeds(folder, &["run", "scan.ron"]);
    let values: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("slice.json")).expect("read")).expect("JSON");
    let flat: Vec<f64> = values.to_string().split(['[', ']', ',']).filter_map(|v| v.trim().parse().ok()).collect();
    assert_eq!(flat, [0.0, 0.0, 0.25, 0.75, 1.0, 0.5], "{values}");
}

/// The sequence 1, 2, 3, 4 and what remembering nodes make of it.
#[test]
fn frames_remember_as_many_frames_as_they_say() {
    let folder = folder();
    let folder = folder.path();
    let graph = r#"Graph(version: 1, nodes: {
        "now":  Constant(color: "=frame", size: 4),
        "one":  Constant(color: 1, size: 4),
        "none": Constant(color: 0, size: 4),
        "mean": Accumulate(image: "now"),
        "ema":  Accumulate(image: "now", op: Ema(alpha: 0.5)),
        "prev": Feedback(init: "none", next: "sum"),
        "sum":  Math(a: "prev", b: "one", op: Add),
        "late": Feedback(init: "none", next: "now", delay: 2),
    }, outputs: {"mean": "mean", "ema": "ema", "sum": "sum", "late": "late"})"#;
    fs::write(folder.join("frames.ron"), graph).expect("written");
    let outputs = ["mean", "ema", "sum", "late"];
    let named = outputs.map(|o| format!("{o}={o}.####.pfm"));
    let arguments: Vec<&str> = named.iter().flat_map(|n| ["-o", n]).collect();
    succeeds(folder, &[&["run", "frames.ron", "--frames", "1-4"], arguments.as_slice()].concat());
    let first = |output: &str, frame: u32| {
        let bytes = fs::read(folder.join(format!("{output}.{frame:04}.pfm"))).expect("written");
        let end: [u8; 4] = bytes[bytes.len() - 4..].try_into().expect("four");
        // The scale of a PFM is negative when its numbers are little endian.
        if bytes.windows(2).any(|w| w == b"-1") { f32::from_le_bytes(end) } else { f32::from_be_bytes(end) }
    };
    let expected: [[f32; 4]; 4] = [[1.0, 1.5, 2.0, 2.5], [1.0, 1.5, 2.25, 3.125], [1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 1.0, 2.0]];
    for (output, expected) in outputs.iter().zip(expected) {
        assert_eq!([1, 2, 3, 4].map(|frame| first(output, frame)), expected, "{output}");
    }
}

/// Every half goes through passes that store it, to the bit; of NaN only that it is none.
#[test]
fn every_half_comes_out_as_it_went_in() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let form = pipe_io::Form {
        sample: pipe_io::Sample::F16,
        layout: pipe_io::Layout::Planar,
        channels: pipe_io::Channels::Y,
        alpha: pipe_io::Alpha::None,
        colour: pipe_io::Colour::LINEAR_REC709,
    };
    let halves: Vec<u8> = (0..=u16::MAX).flat_map(u16::to_ne_bytes).collect();
    let picture = form.picture(256, 256, halves.clone(), pipe_io::Metadata::default());
    let path = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let target = pipe_io::Target::parse(&path("in.exr")).expect("a target");
    let options = pipe_io::WriteOptions { channels: Some(pipe_io::Channels::Y), ..pipe_io::WriteOptions::default() };
    pipe_io::write(&target, &picture, &options).expect("written");
    let graph =
        r#"Graph(version: 1, inputs: {"in": Image}, outputs: {"out": "b"}, nodes: {"a": Flip(image: "in"), "b": Flip(image: "a")})"#;
    fs::write(folder.join("twice.ron"), graph).expect("written");
    succeeds(folder, &["run", "twice.ron", "in.exr", "out.exr"]);
    let got = pipe_io::read(&pipe_io::Source::parse(&path("out.exr")), &pipe_io::ReadOptions::default()).expect("read");
    assert_eq!(got.sample, pipe_io::Sample::F16);
    let is_nan = |h: u16| h & 0x7c00 == 0x7c00 && h & 0x3ff != 0;
    for (a, b) in halves.chunks_exact(2).zip(got.bytes.chunks_exact(2)) {
        let (a, b) = (u16::from_ne_bytes([a[0], a[1]]), u16::from_ne_bytes([b[0], b[1]]));
        assert!(a == b || is_nan(a) && is_nan(b), "{a:#06x} became {b:#06x}");
    }
}
