//! Files → values, each decoded once for as long as it stays what it is.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use pipe_graph::graph::{Graph, Work};
use pipe_graph::node::FileSource;
use pipe_graph::types::EdgeKind;
use pipe_io::{Header, Layout, Picture, ReadOptions, RowReader, Source};
use pipe_plan::lower::file_name;

use crate::Failure;
use crate::run::{Decoded, Inputs, Job};

/// What tells that a file is still the one that was read.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Stamp {
    path: PathBuf,
    modified: SystemTime,
    length: u64,
}

impl Stamp {
    /// `None` for streams and for what is not there.
    fn of(path: &Path) -> Option<Self> {
        let about = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?;
        Some(Self { path: path.to_owned(), modified: about.modified().ok()?, length: about.len() })
    }
}

/// Decodes the files of one job after another, and holds what the last one used.
#[derive(Default)]
pub struct Decoder {
    /// By input or node file, with the name of the file.
    held: HashMap<(String, String), (Stamp, Arc<Decoded>)>,
}

impl Decoder {
    /// Reads every input file of a job.
    pub fn inputs(&mut self, job: &Job, kinds: &HashMap<String, EdgeKind>) -> Result<Inputs, Failure> {
        let files = job.inputs.iter().map(|(name, file)| {
            let kind = match kinds.get(name) {
                Some(kind @ (EdgeKind::Table | EdgeKind::Volume)) => *kind,
                _ => EdgeKind::Image,
            };
            (name.clone(), file.clone(), kind)
        });
        self.all(files.collect(), &job.read, job.budget)
    }

    /// Reads the files that nodes of the graph read, loops included.
    pub(crate) fn files_of(&mut self, graph: &Graph, read: &ReadOptions, budget: Option<u64>) -> Result<Inputs, Failure> {
        let mut files: Vec<(String, String, EdgeKind)> = Vec::new();
        let mut open: Vec<&Graph> = vec![graph];
        while let Some(graph) = open.pop() {
            for (_, instance) in graph.iter() {
                match &instance.work {
                    Work::Node(node) => {
                        let Some(source) = node.file() else { continue };
                        let name = file_name(&source);
                        let (file, kind) = match source {
                            FileSource::Image(path) => (path, EdgeKind::Image),
                            FileSource::Volume(path) => (path, EdgeKind::Volume),
                        };
                        if files.iter().all(|(other, ..)| *other != name) {
                            files.push((name, file.clone(), kind));
                        }
                    }
                    Work::Iterate(iteration) => open.push(&iteration.body),
                    _ => {}
                }
            }
        }
        self.all(files, read, budget)
    }

    fn all(&mut self, files: Vec<(String, String, EdgeKind)>, read: &ReadOptions, budget: Option<u64>) -> Result<Inputs, Failure> {
        let mut before = std::mem::take(&mut self.held);
        let mut inputs = Inputs::new();
        for (name, file, kind) in files {
            let stamp = path(&file, kind).and_then(|path| Stamp::of(&path));
            let key = (name.clone(), file);
            let known = before.remove(&key).filter(|(held, _)| Some(held) == stamp.as_ref()).map(|(_, decoded)| decoded);
            let decoded = known.map_or_else(|| one(&key.1, kind, read, budget).map(Arc::new), Ok)?;
            if let Some(stamp) = stamp {
                self.held.insert(key, (stamp, decoded.clone()));
            }
            inputs.insert(name, decoded);
        }
        Ok(inputs)
    }
}

/// The path that the name of an input file means, without what is selected in the file.
pub(crate) fn path(file: &str, kind: EdgeKind) -> Option<PathBuf> {
    if kind == EdgeKind::Table { Some(PathBuf::from(file)) } else { Source::parse(file).path }
}

/// A picture of which only the header was read.
pub struct Distant {
    source: Source,
    read: ReadOptions,
    /// What the file says.
    pub(crate) header: Header,
    /// In which order samples follow each other.
    pub(crate) layout: Layout,
}

impl Distant {
    /// Bytes of pixels from which on a picture is better read row by row.
    const LARGE: u64 = 1 << 30;

    /// The picture, if it is so large that it is better not held whole: by itself, or beside the budget of a run. A stream
    /// or a pipe, which can be read once only, is held anyway.
    fn of(source: &Source, read: &ReadOptions, budget: Option<u64>) -> Result<Option<Self>, Failure> {
        if !source.path.as_deref().is_some_and(Path::is_file) {
            return Ok(None);
        }
        // What is beyond the limits of pictures that are held is not beyond those of rows.
        if let Ok(h) = pipe_io::probe(source, read) {
            let bytes = u64::from(h.width) * u64::from(h.height) * (h.channels.count() * h.sample.bytes()) as u64;
            if bytes < Self::LARGE.min(budget.unwrap_or(u64::MAX) / 4) {
                return Ok(None);
            }
        }
        let reader = RowReader::open(source, read)?;
        Ok(Some(Self { source: source.clone(), read: *read, header: reader.header().clone(), layout: reader.layout() }))
    }

    /// What gives its rows.
    pub(crate) fn rows(&self) -> Result<RowReader, Failure> {
        Ok(RowReader::open(&self.source, &self.read)?)
    }

    /// All of it.
    pub(crate) fn picture(&self) -> Result<Picture, Failure> {
        Ok(pipe_io::read(&self.source, &self.read)?)
    }
}

fn one(file: &str, kind: EdgeKind, read: &ReadOptions, budget: Option<u64>) -> Result<Decoded, Failure> {
    let source = Source::parse(file);
    if kind == EdgeKind::Image
        && let Some(distant) = Distant::of(&source, read, budget)?
    {
        return Ok(Decoded::Distant(distant));
    }
    Ok(match kind {
        EdgeKind::Table => Decoded::Table(pipe_io::table::read(Path::new(file))?),
        EdgeKind::Volume => Decoded::Volume(pipe_io::volume::read(&source, &read.limits)?),
        _ => Decoded::Picture(pipe_io::read(&source, read)?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_decoded_again_only_when_it_changed() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("table.csv");
        let mut job = Job::new("any");
        job.bind_input("table", &file.to_string_lossy());
        let kinds = HashMap::from([("table".to_owned(), EdgeKind::Table)]);
        let mut decoder = Decoder::default();
        let mut read = || decoder.inputs(&job, &kinds).expect("it is read")["table"].clone();
        std::fs::write(&file, "1\n2\n").expect("written");
        let first = read();
        assert!(Arc::ptr_eq(&first, &read()));
        std::fs::write(&file, "1\n2\n3\n").expect("written");
        let second = read();
        assert!(!Arc::ptr_eq(&first, &second));
        assert!(Arc::ptr_eq(&second, &read()));
    }
}
