//! Files that appear whole or not at all.
//!
//! A temporary file in the same folder (so that renaming does not copy), written, synced, then renamed over the target:
//! an interrupted or failed run leaves the old file untouched. On Linux the temporary file has no name until it is
//! whole, so that even a killed process leaves nothing behind. What is no regular file (`/dev/null`, a pipe) cannot be
//! replaced and is written directly; a symbolic link is followed, so that the link stays and its target changes.

use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, Seek, SeekFrom, Stdout, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use tempfile::NamedTempFile;

/// A file being written. Dropped before [`commit`](Self::commit), it leaves nothing behind.
#[derive(Debug)]
pub struct AtomicFile {
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Temporary {
        file: NamedTempFile,
        target: PathBuf,
        permissions: Option<Permissions>,
    },
    #[cfg(target_os = "linux")]
    Unnamed {
        file: File,
        target: PathBuf,
        permissions: Option<Permissions>,
    },
    Direct(File),
    Stdout(Stdout),
}

impl AtomicFile {
    /// Begins to write `path`; `None` is the standard output.
    ///
    /// Errors: the folder does not exist or may not be written to; `path` is a folder.
    pub fn create(path: Option<&Path>) -> io::Result<Self> {
        let Some(path) = path else { return Ok(Self { kind: Kind::Stdout(io::stdout()) }) };
        let target = follow(path)?;
        let existing = match fs::metadata(&target) {
            Ok(metadata) => Some(metadata),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        if let Some(metadata) = &existing {
            if metadata.is_dir() {
                return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
            }
            if !metadata.is_file() {
                return Ok(Self { kind: Kind::Direct(OpenOptions::new().write(true).open(&target)?) });
            }
            // A file that its owner made read-only is not to be replaced just because its folder allows it.
            if metadata.permissions().readonly() {
                return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file there is read-only"));
            }
        }
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::metadata(folder)?;
        let permissions = existing.map(|metadata| metadata.permissions());
        // Where the file system has no files without names, a hidden one serves.
        #[cfg(target_os = "linux")]
        if let Ok(file) = unnamed::create(folder) {
            return Ok(Self { kind: Kind::Unnamed { file, target, permissions } });
        }
        let prefix = hidden(&target);
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(".tmp");
        #[cfg(unix)]
        let everyone = {
            use std::os::unix::fs::PermissionsExt;
            // As any new file: the umask takes away what the user does not want.
            Permissions::from_mode(0o666)
        };
        #[cfg(unix)]
        builder.permissions(everyone);
        let file = builder.tempfile_in(folder)?;
        Ok(Self { kind: Kind::Temporary { file, target, permissions } })
    }

    /// Syncs the file and puts it in its place.
    pub fn commit(self) -> io::Result<()> {
        match self.kind {
            Kind::Temporary { mut file, target, permissions } => {
                file.flush()?;
                if let Some(permissions) = permissions {
                    file.as_file().set_permissions(permissions)?;
                }
                file.as_file().sync_all()?;
                file.persist(target).map(drop).map_err(|error| error.error)
            }
            #[cfg(target_os = "linux")]
            Kind::Unnamed { file, target, permissions } => {
                if let Some(permissions) = permissions {
                    file.set_permissions(permissions)?;
                }
                file.sync_all()?;
                unnamed::place(&file, &target)
            }
            Kind::Direct(mut file) => file.flush(),
            Kind::Stdout(mut stream) => stream.flush(),
        }
    }

    /// Whether what was written can be gone back to.
    pub(crate) fn seeks(&self) -> bool {
        match self.kind {
            Kind::Temporary { .. } => true,
            #[cfg(target_os = "linux")]
            Kind::Unnamed { .. } => true,
            Kind::Direct(_) | Kind::Stdout(_) => false,
        }
    }

    /// Writes a whole file at once.
    pub fn write_whole(path: Option<&Path>, bytes: &[u8]) -> io::Result<()> {
        let mut file = Self::create(path)?;
        file.write_all(bytes)?;
        file.commit()
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.kind {
            Kind::Temporary { file, .. } => file.write(bytes),
            #[cfg(target_os = "linux")]
            Kind::Unnamed { file, .. } => file.write(bytes),
            Kind::Direct(file) => file.write(bytes),
            Kind::Stdout(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.kind {
            Kind::Temporary { file, .. } => file.flush(),
            #[cfg(target_os = "linux")]
            Kind::Unnamed { file, .. } => file.flush(),
            Kind::Direct(file) => file.flush(),
            Kind::Stdout(stream) => stream.flush(),
        }
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match &mut self.kind {
            Kind::Temporary { file, .. } => file.seek(to),
            #[cfg(target_os = "linux")]
            Kind::Unnamed { file, .. } => file.seek(to),
            Kind::Direct(_) | Kind::Stdout(_) => Err(io::ErrorKind::NotSeekable.into()),
        }
    }
}

/// A file for an encoder that wants it for itself and does not give it back.
#[derive(Clone)]
pub(crate) struct Shared(Arc<Mutex<AtomicFile>>);

impl Shared {
    pub(crate) fn new(file: AtomicFile) -> Self {
        Self(Arc::new(Mutex::new(file)))
    }

    /// The file, once the encoder is gone.
    pub(crate) fn into_file(self) -> AtomicFile {
        let file = Arc::into_inner(self.0).expect("the encoder is gone, so this is the only handle");
        file.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).flush()
    }
}

/// How the names of temporary files for a target begin.
fn hidden(target: &Path) -> String {
    format!(".{}.", target.file_name().unwrap_or_default().to_string_lossy())
}

/// Files without names: `O_TMPFILE`, and the link that gives them one.
#[cfg(target_os = "linux")]
mod unnamed {
    use std::fs::{self, File, OpenOptions};
    use std::io;
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::OpenOptionsExt;
    use std::path::Path;

    use rustix::fs::{AtFlags, CWD, OFlags, linkat};

    /// Fails where the file system has none, or where there is no way to name one later.
    pub(super) fn create(folder: &Path) -> io::Result<File> {
        fs::metadata("/proc/self/fd")?;
        OpenOptions::new().read(true).write(true).mode(0o666).custom_flags(OFlags::TMPFILE.bits().cast_signed()).open(folder)
    }

    /// Gives the file its name. A name that is taken is given by way of a second one, for links replace nothing.
    pub(super) fn place(file: &File, target: &Path) -> io::Result<()> {
        let link = |name: &Path| {
            let source = format!("/proc/self/fd/{}", file.as_raw_fd());
            linkat(CWD, source, CWD, name, AtFlags::SYMLINK_FOLLOW).map_err(io::Error::from)
        };
        match link(target) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            other => return other,
        }
        for n in 0_u64.. {
            let second = target.with_file_name(format!("{}{}-{n}.tmp", super::hidden(target), std::process::id()));
            match link(&second) {
                Ok(()) => {
                    return fs::rename(&second, target).inspect_err(|_| {
                        let _ = fs::remove_file(&second);
                    });
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        unreachable!("some number is free")
    }
}

/// Where a chain of symbolic links ends, whether or not something is there.
fn follow(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_path_buf();
    for _ in 0..40 {
        match fs::read_link(&path) {
            Ok(link) => path = path.parent().unwrap_or(Path::new("")).join(link),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("its symbolic links go in a circle"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn only_a_commit_changes_the_target() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let mut file = AtomicFile::create(Some(&path)).unwrap();
        file.write_all(b"half").unwrap();
        #[cfg(target_os = "linux")]
        assert_eq!(names(folder.path()), ["a.txt"]);
        drop(file);
        assert_eq!((names(folder.path()), fs::read(&path).unwrap()), (vec!["a.txt".to_owned()], b"old".to_vec()));
        AtomicFile::write_whole(Some(&path), b"new").unwrap();
        assert_eq!((names(folder.path()), fs::read(&path).unwrap()), (vec!["a.txt".to_owned()], b"new".to_vec()));
    }

    #[cfg(unix)]
    #[test]
    fn links_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("a"), folder.path().join("b"));
        fs::write(&path, "old").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        symlink("a", &link).unwrap();
        AtomicFile::write_whole(Some(&link), b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
    }

    #[cfg(unix)]
    #[test]
    fn devices_are_written_directly() {
        AtomicFile::write_whole(Some(Path::new("/dev/null")), b"gone").unwrap();
    }

    #[test]
    fn folders_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(AtomicFile::create(Some(folder.path())).unwrap_err().kind(), io::ErrorKind::IsADirectory);
        let missing = folder.path().join("no/file");
        assert_eq!(AtomicFile::create(Some(&missing)).unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}
