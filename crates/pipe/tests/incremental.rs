//! What runs again when something changes, as a user sees it; and that files are what a full run makes them.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use tempfile::TempDir;

/// A folder with a picture `in.exr` in it.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let photograph = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/workshop.exr");
    fs::copy(photograph, folder.path().join("in.exr")).expect("copied");
    folder
}

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pipe"));
    command.args(arguments).current_dir(folder).env("XDG_CACHE_HOME", folder.join("cache"));
    command
}

#[track_caller]
fn succeeds(folder: &Path, arguments: &[&str]) {
    let output = command(folder, arguments).output().expect("it starts");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A program that goes on, with what it says line by line.
struct Running {
    child: Child,
    lines: Receiver<String>,
}

impl Running {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut child = command(folder, arguments).stderr(Stdio::piped()).spawn().expect("it starts");
        let (tx, lines) = channel();
        let errors = BufReader::new(child.stderr.take().expect("piped"));
        std::thread::spawn(move || errors.lines().map_while(Result::ok).try_for_each(|line| tx.send(line)));
        Self { child, lines }
    }

    /// Waits for a line that says this.
    #[track_caller]
    fn says(&self, what: &str) {
        let mut before = Vec::new();
        loop {
            let line = self.lines.recv_timeout(Duration::from_secs(60)).unwrap_or_else(|_| panic!("no `{what}` in {before:#?}"));
            if line.contains(what) {
                return;
            }
            before.push(line);
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

fn graph(sigma: f32, gamma: f32) -> String {
    format!(
        r#"Graph(version: 1, inputs: {{"in": Image}}, nodes: {{
            "soft": GaussianBlur(image: "in", sigma: {sigma}),
            "more": GaussianBlur(image: "soft", sigma: 2.0),
            "out":  Gamma(image: "more", gamma: {gamma}),
        }}, outputs: {{"out": "out"}})"#
    )
}

#[test]
fn watching_runs_what_changed_and_survives_mistakes() {
    let folder = folder();
    let folder = folder.path();
    let save = |text: String| fs::write(folder.join("look.ron"), text).expect("written");
    let same = || {
        succeeds(folder, &["run", "look.ron", "in.exr", "fresh.pfm"]);
        assert_eq!(fs::read(folder.join("out.pfm")).expect("read"), fs::read(folder.join("fresh.pfm")).expect("read"));
    };
    save(graph(3.0, 1.5));
    let watch = Running::start(folder, &["watch", "look.ron", "in.exr", "out.pfm"]);
    watch.says("passes ran");
    same();
    save(graph(3.0, 2.5));
    watch.says("kept");
    same();
    save(graph(3.0, 2.5).replace("Gamma", "Gama"));
    watch.says("Gama");
    // Nothing is as it was, but for the input's upload.
    save(graph(4.0, 2.5));
    watch.says("passes ran");
    same();
}

#[test]
fn what_is_the_same_in_every_frame_is_made_once() {
    let folder = folder();
    let folder = folder.path();
    let graph = r#"Graph(version: 1, inputs: {"in": Image, "still": Image}, nodes: {
        "soft":  GaussianBlur(image: "still", sigma: 3.0),
        "mixed": Mix(a: "in", b: "soft", factor: 0.25),
        "trail": Feedback(init: "in", next: "sum"),
        "sum":   Mix(a: "mixed", b: "trail"),
    }, outputs: {"out": "mixed", "trail": "sum"})"#;
    fs::write(folder.join("over.ron"), graph).expect("written");
    for frame in 1..=4 {
        let gamma = format!("gamma={}", 0.5 + 0.25 * f64::from(frame));
        let one = r#"Graph(version: 1, params: {"gamma": F32(default: 1.0)}, inputs: {"in": Image},
            nodes: {"g": Gamma(image: "in", gamma: "=gamma")}, outputs: {"out": "g"})"#;
        fs::write(folder.join("gamma.ron"), one).expect("written");
        succeeds(folder, &["run", "gamma.ron", "in.exr", &format!("in.{frame:04}.exr"), "--set", &gamma]);
    }
    let run = |moving: &str, still: &str, out: &str, stats: &str, frames: &[&str]| {
        let (input, still) = (format!("in={moving}"), format!("still={still}"));
        let (out, trail) = (format!("out={out}.####.pfm"), format!("trail={out}-trail.####.pfm"));
        let all = ["run", "over.ron", "-i", &input, "-i", &still, "-o", &out, "-o", &trail, "--stats", stats];
        succeeds(folder, &[&all, frames].concat());
    };
    run("in.####.exr", "in.exr", "kept", "kept.json", &["--frames", "1-4"]);
    // The same pictures, but as far as anyone can tell other files in every frame: nothing is kept.
    for frame in 1..=4 {
        fs::copy(folder.join("in.exr"), folder.join(format!("still.{frame:04}.exr"))).expect("copied");
    }
    run("in.####.exr", "still.####.exr", "all", "all.json", &["--frames", "1-4"]);
    for name in ["", "-trail"] {
        for frame in 1..=4 {
            let [kept, all] = ["kept", "all"].map(|of| fs::read(folder.join(format!("{of}{name}.{frame:04}.pfm"))).expect("read"));
            assert!(kept == all, "frame {frame} of {name}");
        }
    }
    let passes = |stats: &str, what: &str| {
        let text = fs::read(folder.join(stats)).expect("read");
        serde_json::from_slice::<serde_json::Value>(&text).expect("JSON")[what].as_u64().expect("a number")
    };
    assert_eq!(passes("all.json", "passes_kept"), 0);
    assert!(passes("kept.json", "passes_kept") >= 1);
    assert!(passes("kept.json", "passes_run") < passes("all.json", "passes_run"));
    // Too little memory to keep anything: still right.
    let least = (passes("all.json", "peak_bytes") + (4 << 20)).to_string();
    run("in.####.exr", "in.exr", "tight", "tight.json", &["--frames", "1-4", "--vram", &least]);
    assert!(passes("tight.json", "peak_bytes") < passes("kept.json", "peak_bytes"));
    let [kept, tight] = ["kept", "tight"].map(|of| fs::read(folder.join(format!("{of}.0004.pfm"))).expect("read"));
    assert!(kept == tight);
}
