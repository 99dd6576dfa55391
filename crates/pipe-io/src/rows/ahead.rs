//! Decoding before a band is asked for, and encoding after it was given.
//!
//! A pipeline alternates between the file and the GPU. One thread beside it lets the two overlap; one band, and not
//! more, is decoded ahead or waits to be encoded, so the memory is that of two bands.

use std::ops::Range;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::{self, JoinHandle};

use super::{RowReader, RowWriter};
use crate::error::{Error, Result};

/// Bands that are decoded on a thread of their own, each while the caller works on the one before it. Ends with the
/// last band, or after an error.
#[derive(Debug)]
pub struct ReadAhead {
    /// Given up first when this is dropped, which ends the thread.
    bands: Option<Receiver<Result<Vec<u8>>>>,
    spent: Sender<Vec<u8>>,
    thread: Option<JoinHandle<()>>,
}

impl RowReader {
    /// Decodes these rows, in this order, ahead of their being asked for.
    ///
    /// # Panics
    ///
    /// As [`read`](Self::read) does, when the band is asked for.
    pub fn ahead(mut self, bands: Vec<Range<u32>>) -> ReadAhead {
        // A channel without room: what is decoded waits in the thread.
        let (give, take) = sync_channel(0);
        let (spent, reused) = channel::<Vec<u8>>();
        let decode = move || {
            for rows in bands {
                let mut band = reused.try_recv().unwrap_or_default();
                let outcome = self.read(rows, &mut band).map(|()| band);
                let failed = outcome.is_err();
                if give.send(outcome).is_err() || failed {
                    return;
                }
            }
        };
        ReadAhead { bands: Some(take), spent, thread: Some(thread::spawn(decode)) }
    }
}

impl ReadAhead {
    /// Gives back a band that is no longer needed; a later one will use its memory.
    pub fn reuse(&self, band: Vec<u8>) {
        // The thread may have ended already.
        let _ = self.spent.send(band);
    }
}

impl Iterator for ReadAhead {
    type Item = Result<Vec<u8>>;

    fn next(&mut self) -> Option<Self::Item> {
        let band = self.bands.as_ref()?.recv().ok();
        if band.is_none() {
            self.bands = None;
            join(self.thread.take());
        }
        band
    }
}

impl Drop for ReadAhead {
    fn drop(&mut self) {
        self.bands = None;
        if let Some(thread) = self.thread.take() {
            // A panic in it was for the band that nobody asked for.
            let _ = thread.join();
        }
    }
}

/// A file that is encoded on a thread of its own, each band while the caller works on the next. Dropped before
/// [`finish`](Self::finish), it leaves nothing behind.
#[derive(Debug)]
pub struct WriteBehind {
    /// Given up first when this is dropped, which ends the thread.
    bands: Option<SyncSender<Vec<u8>>>,
    /// Its name, for messages.
    file: String,
    spent: Receiver<Vec<u8>>,
    thread: Option<JoinHandle<Result<RowWriter>>>,
}

impl RowWriter {
    /// Encodes bands behind their being given.
    pub fn behind(mut self) -> WriteBehind {
        let file = self.target.to_string();
        let (give, take) = sync_channel::<Vec<u8>>(0);
        let (done, spent) = channel();
        let encode = move || {
            for band in take {
                self.write(&band)?;
                // Whether anybody wants the memory is not our concern.
                let _ = done.send(band);
            }
            Ok(self)
        };
        WriteBehind { bands: Some(give), file, spent, thread: Some(thread::spawn(encode)) }
    }
}

impl WriteBehind {
    /// Appends a band, and gives back one that was encoded, for its memory: empty, if none was yet.
    ///
    /// Errors: those of [`RowWriter::write`] for this band or, more likely, an earlier one.
    pub fn write(&mut self, band: Vec<u8>) -> Result<Vec<u8>> {
        let taken = self.bands.as_ref().is_some_and(|bands| bands.send(band).is_ok());
        // The thread ends early only by an error.
        if !taken {
            self.end()?;
        }
        Ok(self.spent.try_recv().unwrap_or_default())
    }

    /// Encodes what is left, ends the file and puts it in its place.
    ///
    /// Errors: those of [`RowWriter::write`] for the last bands, and of [`RowWriter::finish`].
    pub fn finish(mut self) -> Result<()> {
        self.end()?.finish()
    }

    /// Waits for the thread: the writer, or what kept it from writing on.
    fn end(&mut self) -> Result<RowWriter> {
        self.bands = None;
        join(self.thread.take()).unwrap_or_else(|| {
            let reason = "an earlier band could not be written".to_owned();
            Err(Error::Form { file: self.file.clone(), reason })
        })
    }
}

impl Drop for WriteBehind {
    fn drop(&mut self) {
        self.bands = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Waits for a thread; its panic goes on here.
fn join<T>(thread: Option<JoinHandle<T>>) -> Option<T> {
    thread.map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
}
