//! Every kind of mistake, told as a user sees it.
//!
//! `tests/diagnostics/` holds one small graph for each kind of mistake, with what is printed for it beside it in a
//! `.stderr` file. After a change of wording, read the difference, then bless it:
//!
//!     PIPE_BLESS=1 cargo test -p pipe-tests --test diagnostics

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use pipe::project::{Project, World};
use pipe_graph::resolve::Request;
use pipe_graph::types::{EdgeType, ImageType};

const FOLDER: &str = "tests/diagnostics";
const HOW: &str = "PIPE_BLESS=1 cargo test -p pipe-tests --test diagnostics";

#[test]
fn every_mistake_is_told_as_expected() {
    // Messages show paths as they were given; these are relative to the workspace, on every machine.
    std::env::set_current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("..")).expect("the workspace is there");
    let bless = std::env::var_os("PIPE_BLESS").is_some();
    let mut graphs: Vec<PathBuf> = std::fs::read_dir(FOLDER)
        .expect("the folder is there")
        .map(|entry| entry.expect("can be listed").path())
        .filter(|path| path.extension().is_some_and(|e| e == "ron"))
        .collect();
    graphs.sort();
    assert!(graphs.len() >= 45, "only {} graphs in {FOLDER}", graphs.len());
    let mut differences = String::new();
    for graph in &graphs {
        let told = told(graph);
        let golden = graph.with_extension("stderr");
        if told.is_empty() {
            let _ = writeln!(differences, "\n{}\nnothing is told", graph.display());
            continue;
        }
        if bless {
            std::fs::write(&golden, &told).expect("the golden file can be written");
            continue;
        }
        let expected = std::fs::read_to_string(&golden).unwrap_or_default().replace("\r\n", "\n");
        if told != expected {
            let _ = writeln!(differences, "\n{}\n{}", graph.display(), difference(&expected, &told));
        }
    }
    assert!(differences.is_empty(), "{differences}\n- expected, + told; if the new text is better:\n    {HOW}");
}

/// What is told of one graph.
fn told(path: &Path) -> String {
    let name = path.to_str().expect("names are plain").replace('\\', "/");
    let mut project = Project::open(&name).unwrap_or_else(|failure| panic!("{name}: {failure:?}"));
    let image = |size, channels| EdgeType::Image(ImageType::new(size, channels));
    let inputs = [
        ("in", image([64, 48], 4)),
        ("other", image([32, 32], 4)),
        ("grey", image([64, 48], 1)),
        ("fog", EdgeType::volume([8, 8, 8], 1)),
        ("table", EdgeType::table(16, pipe_graph::types::Element::F32)),
    ];
    let declared: Vec<String> = project.document.iter().flat_map(|d| &d.inputs).map(|input| input.name.value.clone()).collect();
    let request = Request {
        inputs: inputs.into_iter().map(|(name, ty)| (name.to_owned(), ty)).filter(|(name, _)| declared.contains(name)).collect(),
        ..Request::default()
    };
    let _ = project.resolve(&request, &World::default());
    let told = project.diagnostics.render(&project.sources, false);
    // The system words its errors in its own way.
    told.replace("The system cannot find the file specified. (os error 2)", "No such file or directory (os error 2)")
}

/// Lines that differ, with the equal ones around them left as they are.
fn difference(expected: &str, told: &str) -> String {
    let (old, new): (Vec<_>, Vec<_>) = (expected.lines().collect(), told.lines().collect());
    let head = old.iter().zip(&new).take_while(|(a, b)| a == b).count();
    let rest = old[head..].iter().rev().zip(new[head..].iter().rev()).take_while(|(a, b)| a == b).count();
    let mut out = String::new();
    let mut put = |mark: char, lines: &[&str]| {
        for line in lines {
            let _ = writeln!(out, "{mark} {line}");
        }
    };
    put(' ', &old[head.saturating_sub(3)..head]);
    put('-', &old[head..old.len() - rest]);
    put('+', &new[head..new.len() - rest]);
    put(' ', &old[old.len() - rest..][..rest.min(3)]);
    out
}
