//! A graph file on its way to a [`Graph`]: reading, checking, and saying all that is wrong.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use pipe_graph::diagnostic::{Diagnostics, Sources};
use pipe_graph::document::{Document, parse};
use pipe_graph::graph::Graph;
use pipe_graph::node::{Loader, TableFile};
use pipe_graph::resolve::{Request, resolve};
use pipe_graph::syntax::MOST_BYTES;
use pipe_graph::types::{ImageType, VolumeType};

use crate::{Failure, forms, presets};

/// Stack of the thread that resolves graphs: subgraphs may be nested as deep as anyone likes.
const STACK: usize = 512 << 20;

/// The file system, with the presets behind it.
#[derive(Debug, Clone, Default)]
pub struct World {
    /// How image files are opened.
    pub read: pipe_io::ReadOptions,
    /// What was asked for.
    asked: Arc<Mutex<BTreeSet<PathBuf>>>,
}

impl World {
    /// A world in which image files are opened like this.
    pub fn new(read: pipe_io::ReadOptions) -> Self {
        Self { read, ..Self::default() }
    }

    /// Every file that was asked for so far, whether it was there or not.
    pub fn files(&self) -> BTreeSet<PathBuf> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn note(&self, path: &Path) {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_owned());
    }
}

impl Loader for World {
    fn text(&self, path: &Path, most: usize) -> Result<String, String> {
        self.note(path);
        match read_most(path, most) {
            Ok(bytes) if bytes.len() > most => Err(format!("{} has more than {most} bytes", path.display())),
            Ok(bytes) => String::from_utf8(bytes).map_err(|_| format!("{} is no text", path.display())),
            Err(e) => {
                // A file beside a preset is a preset too.
                let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
                presets::text(&name).map(str::to_owned).ok_or_else(|| format!("{}: {e}", path.display()))
            }
        }
    }

    fn image(&self, path: &Path) -> Result<ImageType, String> {
        let source = pipe_io::Source::parse(&path.to_string_lossy());
        self.note(source.path.as_deref().unwrap_or(path));
        let header = pipe_io::probe(&source, &self.read).map_err(|e| e.to_string())?;
        Ok(ImageType::new([header.width, header.height], forms::image_channels(header.channels)))
    }

    fn volume(&self, path: &Path) -> Result<VolumeType, String> {
        let source = pipe_io::Source::parse(&path.to_string_lossy());
        self.note(source.path.as_deref().unwrap_or(path));
        pipe_io::volume::probe(&source, &self.read.limits).map(|header| forms::volume_type(&header)).map_err(|e| e.to_string())
    }

    fn table(&self, path: &Path) -> Result<TableFile, String> {
        self.note(path);
        match pipe_io::table::read(path).map_err(|e| e.to_string())? {
            pipe_io::table::Table::Float(v) => Ok(TableFile::F32(v)),
            pipe_io::table::Table::Uint(v) => Ok(TableFile::U32(v)),
        }
    }
}

/// A parsed graph file, with everything said about it so far.
#[derive(Debug)]
pub struct Project {
    /// What the user wrote; `None` when it is no RON.
    pub document: Option<Document>,
    /// The files that places point into.
    pub sources: Sources,
    /// Mistakes and warnings.
    pub diagnostics: Diagnostics,
}

impl Project {
    /// Reads and parses a graph: a path, or the bare name of a preset.
    pub fn open(name: &str) -> Result<Self, Failure> {
        let (path, text) = read_graph(name)?;
        let (mut sources, mut diagnostics) = (Sources::default(), Diagnostics::default());
        let document = parse(&path, &text, &pipe_nodes::REGISTRY, &mut sources, &mut diagnostics);
        Ok(Self { document, sources, diagnostics })
    }

    /// Resolves the graph. Mistakes are added to [`Project::diagnostics`].
    pub fn resolve(&mut self, request: &Request, world: &World) -> Option<Graph> {
        let Self { document, sources, diagnostics } = self;
        let document = document.as_ref()?;
        std::thread::scope(|scope| {
            let work = || resolve(document, request, &pipe_nodes::REGISTRY, world, sources, diagnostics);
            let thread = std::thread::Builder::new().name("resolve".into()).stack_size(STACK).spawn_scoped(scope, work);
            match thread.map(std::thread::ScopedJoinHandle::join) {
                Ok(Ok(graph)) => graph,
                Ok(Err(panic)) => std::panic::resume_unwind(panic),
                Err(_) => None,
            }
        })
    }

    /// Everything said so far, for a terminal or a file.
    pub fn render(&self, colour: bool) -> String {
        self.diagnostics.render(&self.sources, colour)
    }

    /// The failure that the diagnostics amount to.
    pub fn failure(&self, colour: bool) -> Failure {
        let text = self.render(colour);
        Failure::Graph(if text.is_empty() { "the graph cannot be resolved".into() } else { text })
    }
}

/// What a file begins with: all of it, or one byte more than so many.
fn read_most(path: &Path, most: usize) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(most as u64 + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of a graph, and the path that it is known by.
fn read_graph(name: &str) -> Result<(PathBuf, String), Failure> {
    let path = PathBuf::from(name);
    match read_most(&path, MOST_BYTES) {
        // Parsing refuses it for its length, with the place; what it was cut off from does not matter any more.
        Ok(bytes) if bytes.len() > MOST_BYTES => Ok((path, String::from_utf8_lossy(&bytes).into_owned())),
        Ok(bytes) => match String::from_utf8(bytes) {
            Ok(text) => Ok((path, text)),
            Err(_) => Err(Failure::Graph(format!("{name} is no graph: it is not text"))),
        },
        Err(e) => match presets::text(name) {
            Some(text) => {
                Ok((PathBuf::from(if name.ends_with(".ron") { name.to_owned() } else { format!("{name}.ron") }), text.to_owned()))
            }
            None => {
                let near = pipe_graph::diagnostic::nearest(name, presets::names());
                let hint = near.map_or_else(
                    || "`pipe presets` lists the graphs that come with the program".to_owned(),
                    |n| format!("did you mean the preset `{n}`?"),
                );
                Err(Failure::World(format!("cannot read the graph `{name}`: {e}\n  next: {hint}")))
            }
        },
    }
}
