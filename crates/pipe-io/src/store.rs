//! Bytes at any place of a file, whether it is in memory or read as it is wanted.

use std::fs::File;
use std::io;

use crate::error::Fault;

/// What a decoder that jumps about reads from; several threads may at once.
pub(crate) trait Store: Sync {
    /// Bytes of the whole file.
    fn length(&self) -> u64;

    /// `count` bytes from `at` on; `None` where the file ends before. Allocates no more than the file holds.
    fn bytes(&self, at: u64, count: usize) -> Result<Option<Vec<u8>>, Fault>;
}

impl Store for &[u8] {
    fn length(&self) -> u64 {
        self.len() as u64
    }

    fn bytes(&self, at: u64, count: usize) -> Result<Option<Vec<u8>>, Fault> {
        let rest = usize::try_from(at).ok().and_then(|at| self.get(at..));
        Ok(rest.and_then(|rest| rest.get(..count)).map(<[u8]>::to_vec))
    }
}

/// A file on disk.
#[derive(Debug)]
pub(crate) struct FileStore {
    file: File,
    length: u64,
}

impl FileStore {
    pub(crate) fn new(file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self { file, length })
    }

    /// Fills `into` with the bytes from `at` on.
    pub(crate) fn fill(&self, at: u64, into: &mut [u8]) -> Result<(), Fault> {
        read_exact_at(&self.file, at, into).map_err(Fault::reading)
    }
}

impl Store for FileStore {
    fn length(&self) -> u64 {
        self.length
    }

    fn bytes(&self, at: u64, count: usize) -> Result<Option<Vec<u8>>, Fault> {
        if at.checked_add(count as u64).is_none_or(|end| end > self.length) {
            return Ok(None);
        }
        let mut bytes = vec![0; count];
        self.fill(at, &mut bytes)?;
        Ok(Some(bytes))
    }
}

#[cfg(unix)]
fn read_exact_at(file: &File, at: u64, into: &mut [u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, into, at)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut at: u64, mut into: &mut [u8]) -> io::Result<()> {
    while !into.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, into, at)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            count => (at, into) = (at + count as u64, &mut into[count..]),
        }
    }
    Ok(())
}
