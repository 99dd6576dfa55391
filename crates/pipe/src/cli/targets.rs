//! What a run would write, held against what it reads and against each other, before anything is written.
//!
//! Files are compared by where they are, not by how they are spelt: links are followed, and what is not there yet is known
//! by its folder. The names of a sequence are never listed, since `--frames 1-99999999` is quickly typed: a name is asked
//! which frame it is of.

use std::path::{Path, PathBuf};

use pipe::Failure;
use pipe::project::World;
use pipe::run::{Job, readbacks};
use pipe_graph::graph::Graph;
use pipe_io::sequence::{FrameRange, Pattern};
use pipe_io::{Source, Target};

use super::args::RunArgs;

/// A file, or one for each frame.
struct Place {
    /// What it is to the run, for messages.
    what: String,
    /// The file as it was named; `None` is a stream.
    file: Option<PathBuf>,
    /// The place of the frame number in the file's name.
    pattern: Option<Pattern>,
    /// Where the files of the first and of the last frame are.
    ends: Vec<PathBuf>,
}

impl Place {
    fn new(what: String, file: Option<PathBuf>, frames: Option<FrameRange>) -> Result<Self, Failure> {
        let name = file.as_deref().filter(|_| frames.is_some()).and_then(Path::file_name);
        let pattern = name.map(|name| Pattern::parse(&name.to_string_lossy())).transpose()?.flatten();
        let mut place = Self { what, file, pattern, ends: Vec::new() };
        let ends = frames.map_or([0; 2], |frames| [frames.first, frames.last]);
        place.ends = ends.into_iter().filter_map(|frame| place.at(frame)).collect();
        Ok(place)
    }

    /// Where the file of a frame is. Devices are nowhere: nothing in them is lost.
    fn at(&self, frame: u32) -> Option<PathBuf> {
        let file = self.file.as_deref()?;
        let path = real(&self.pattern.as_ref().map_or_else(|| file.to_owned(), |pattern| file.with_file_name(pattern.name(frame))));
        path.metadata().map_or(true, |about| about.is_file()).then_some(path)
    }

    /// Whether this file is that of some frame.
    fn holds(&self, file: &Path, frames: Option<FrameRange>) -> bool {
        let number = || self.pattern.as_ref()?.frame(&file.file_name()?.to_string_lossy());
        let inside = |n: &u32| frames.is_some_and(|frames| frames.contains(*n));
        self.ends.iter().any(|end| end == file) || number().filter(inside).and_then(|n| self.at(n)).is_some_and(|own| own == file)
    }

    /// Whether some file of one is some file of the other.
    fn meets(&self, other: &Self, frames: Option<FrameRange>) -> bool {
        self.ends.iter().any(|file| other.holds(file, frames)) || other.ends.iter().any(|file| self.holds(file, frames))
    }
}

/// Where a path leads.
pub(super) fn real(path: &Path) -> PathBuf {
    let beside = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(folder.canonicalize().ok()?.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(beside).unwrap_or_else(|| path.to_owned())
}

/// What a run writes overwrites nothing that it reads, unless that is meant, and no two things that it writes are one file.
///
/// `graph` is what the graph means, as far as that is known yet, and `world` has seen what files it names.
pub(super) fn refuse_clashes(
    job: &Job,
    a: &RunArgs,
    graph: Option<&Graph>,
    world: &World,
    frames: Option<FrameRange>,
) -> Result<(), Failure> {
    let written = written(job, a, graph, frames)?;
    let read = read(job, world, frames)?;
    for (i, one) in written.iter().enumerate() {
        if let Some(input) = read.iter().find(|input| !job.force && one.meets(input, frames)) {
            let (one, input) = (&one.what, &input.what);
            return Err(Failure::Graph(format!("{one} would overwrite {input}\n  next: choose another name, or add --force")));
        }
        for other in &written[..i] {
            let (first, second) = (&other.what, &one.what);
            if one.file.is_none() && other.file.is_none() {
                return Err(Failure::Graph(format!("{first} and {second} would both go to stdout\n  next: name a file for one of them")));
            }
            if one.meets(other, frames) {
                return Err(Failure::Graph(format!("{first} and {second} would be one file\n  next: give each a name of its own")));
            }
        }
    }
    Ok(())
}

fn written(job: &Job, a: &RunArgs, graph: Option<&Graph>, frames: Option<FrameRange>) -> Result<Vec<Place>, Failure> {
    let mut places = Vec::new();
    let mut add = |what: String, file: Option<PathBuf>| Place::new(what, file, frames).map(|place| places.push(place));
    // Of a name that is no image's the ending decides later; no such name is a stream.
    let file = |text: &str| Target::parse(text).map_or_else(|_| Some(PathBuf::from(text)), |target| target.path);
    for (name, text) in &job.outputs {
        add(format!("the output {text} (`{name}`)"), file(text))?;
    }
    for (node, text) in &job.dumps {
        add(format!("the output {text} (--dump {node})"), file(text))?;
    }
    for (flag, path) in [("--stats", &a.stats), ("--trace", &a.trace)] {
        let Some(path) = path else { continue };
        add(format!("the report {} ({flag})", path.display()), Some(path.clone()).filter(|path| path.as_os_str() != "-"))?;
    }
    for (name, readback) in graph.map(readbacks).into_iter().flatten().filter(|(_, readback)| !readback.path.is_empty()) {
        add(format!("the readback {} (`{}`)", readback.path, name.trim_end_matches(":readback")), Some(readback.path.into()))?;
    }
    Ok(places)
}

fn read(job: &Job, world: &World, frames: Option<FrameRange>) -> Result<Vec<Place>, Failure> {
    let mut places = Vec::new();
    for text in job.inputs.values() {
        places.push(Place::new(format!("the input {text}"), Source::parse(text).path, frames)?);
    }
    // A preset is no file. What the graph names is read as it is named, frame after frame.
    for path in world.files().into_iter().chain([PathBuf::from(&job.graph)]).filter(|path| path.exists()) {
        places.push(Place::new(format!("{}, which the graph is made of or reads", path.display()), Some(path), None)?);
    }
    Ok(places)
}
