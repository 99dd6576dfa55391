//! `presets --gallery`: a page with a picture of every preset, made by running it.

use std::fmt::Write as _;
use std::path::Path;

use pipe::project::{Project, World};
use pipe::run::{Job, Session};
use pipe::{Failure, presets};
use pipe_graph::document::Document;
use pipe_graph::resolve::Request;
use pipe_graph::types::EdgeKind;
use pipe_io::atomic::AtomicFile;

use super::args::PresetsArgs;
use super::{cache_folder, device_choice, output};

/// Writes `README.md` and the pictures into the folder.
pub(super) fn gallery(folder: &Path, a: &PresetsArgs) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|e| Failure::World(format!("cannot create {}: {e}", folder.display())))?;
    let mut session = Session::open(&device_choice(None), cache_folder().as_deref())?;
    let mut page =
        String::from("# Gallery\n\nEvery preset that makes a picture, as `make gallery` ran it. Generated; edit the presets instead.\n");
    let names: Vec<_> = presets::names().collect();
    let bar = output::progress(names.len() as u64, "presets");
    for name in names {
        bar.inc(1);
        let mut project = Project::open(name)?;
        let graph = project.resolve(&Request { frame: 1.0, ..Request::default() }, &World::default());
        let makes_picture = graph.and_then(|g| g.outputs().next().map(|(_, value)| g.ty(value).kind())) == Some(EdgeKind::Image);
        let Some(document) = project.document.filter(|_| makes_picture) else { continue };
        let Some((job, picture)) = job(name, &document, folder, a) else { continue };
        session.run(&job)?;
        describe(&mut page, name, &document, &picture);
    }
    bar.finish_and_clear();
    let path = folder.join("README.md");
    AtomicFile::write_whole(Some(&path), page.as_bytes()).map_err(|e| Failure::World(format!("cannot write {}: {e}", path.display())))
}

/// The run of a preset, and the name of its picture; `None` when it needs more than one file, or a kind that was not given.
fn job(name: &str, document: &Document, folder: &Path, a: &PresetsArgs) -> Option<(Job, String)> {
    let mut job = Job::new(name);
    match document.inputs.as_slice() {
        [] => {}
        [input] => {
            let file = match input.kind {
                EdgeKind::Image => a.image.as_ref(),
                EdgeKind::Volume => a.volume.as_ref(),
                _ => None,
            };
            job.bind_input(&input.name.value, file?);
        }
        _ => return None,
    }
    let (output, _) = document.outputs.first()?;
    let picture = format!("{name}.jpg");
    job.bind_output(&output.value, &folder.join(&picture).display().to_string()).ok()?;
    Some((job, picture))
}

fn describe(page: &mut String, name: &str, document: &Document, picture: &str) {
    let input = match document.inputs.first().map(|i| i.kind) {
        None => "",
        Some(EdgeKind::Volume) => "scan.nii.gz ",
        Some(_) => "in.exr ",
    };
    let _ = write!(page, "\n## {}\n\n{}\n\n    pipe run {name} {input}out.png\n\n", document.name, document.doc);
    for p in &document.params {
        let _ = writeln!(page, "- `{}`: {}", p.name.value, p.doc);
    }
    let _ = write!(page, "\n![{}]({picture})\n", document.name);
}
