//! A picture's rows into a file.

use std::fmt;
use std::io::{self, BufWriter, Cursor, Seek, SeekFrom, Write};

use crate::atomic::{AtomicFile, Shared};
use crate::colour::Colorspace;
use crate::error::{Error, Fault, Result};
use crate::form::{WriteOptions, compression_of};
use crate::guard::shielded;
use crate::output::{check_form, encode_to, named};
use crate::picture::Picture;
use crate::source::{Format, Limits, Target};
use crate::{exr, plain, png, tiff};

/// A file whose picture is written by bands of rows, from top to bottom. It appears under its name when it is
/// [finished](Self::finish); dropped before, it leaves nothing behind, and an earlier file of that name is untouched.
///
/// ```no_run
/// use pipe_io::{Metadata, RowWriter, Target, WriteOptions, output_form};
///
/// let (target, options) = (Target::parse("mosaic.exr")?, WriteOptions::default());
/// let like = output_form(&target, &options, None)?.picture(60_000, 40_000, Vec::new(), Metadata::default());
/// let mut writer = RowWriter::create(&target, &like, &options)?;
/// for top in (0..40_000).step_by(250) {
///     let band: Vec<u8> = todo!("250 rows in that form");
///     writer.write(&band)?;
/// }
/// writer.finish()?;
/// # Ok::<(), pipe_io::Error>(())
/// ```
pub struct RowWriter {
    pub(super) target: Target,
    /// The picture, without its pixels.
    like: Picture,
    /// Bytes of a row of all channels.
    row: usize,
    /// The row that is written next.
    next: usize,
    /// `None` after an error.
    encoder: Option<Encoder>,
}

enum Encoder {
    Exr(exr::RowEncoder<BufWriter<Sink>>),
    Png {
        encoder: png::RowEncoder<Shared>,
        file: Shared,
    },
    Tiff(tiff::Strips<BufWriter<Sink>>),
    /// Behind its header.
    Pfm {
        out: BufWriter<Sink>,
        head: u64,
    },
    Npy(BufWriter<Sink>),
    /// Everything else is gathered, and encoded at the end.
    Whole {
        file: AtomicFile,
        options: WriteOptions,
        bytes: Vec<u8>,
    },
}

impl RowWriter {
    /// Begins a file for a picture like this one, which is in the form that [`output_form`](crate::output_form) asked
    /// for. Its bytes are not looked at.
    ///
    /// Errors: the picture is not in that form; the file cannot be created; the format is not written by rows
    /// ([`Format::by_rows`]) and the picture is beyond the default [`Limits`].
    pub fn create(target: &Target, like: &Picture, options: &WriteOptions) -> Result<Self> {
        check_form(target, like, options)?;
        let whole = !target.format.by_rows() && target.format != Format::Apng;
        let pixel = like.channels.count() * like.sample.bytes();
        if whole && Limits::default().check(like.width.into(), like.height.into(), pixel as u64).is_err() {
            let (name, w, h) = (target.format.name(), like.width, like.height);
            let reason = format!("{name} is encoded whole, for which {w}×{h} pixels are too many; write EXR, PNG, TIFF, PFM or NPY");
            return Err(Error::Form { file: target.to_string(), reason });
        }
        let file = AtomicFile::create(target.path.as_deref()).map_err(|error| Error::write(target, error))?;
        let like = Picture { bytes: Vec::new(), metadata: like.metadata.clone(), ..*like };
        let encoder = shielded(|| Encoder::begin(file, target.format, &like, options)).map_err(|fault| named(target, fault))?;
        Ok(Self { target: target.clone(), row: like.width as usize * pixel, like, next: 0, encoder: Some(encoder) })
    }

    /// Appends a band: the bytes of a picture of the next rows alone.
    ///
    /// Errors: it is not of whole rows, or of more than are left; the file cannot be written, in which case there is
    /// nothing to do but drop the writer.
    pub fn write(&mut self, band: &[u8]) -> Result<()> {
        let rows = band.len() / self.row;
        let left = self.like.height as usize - self.next;
        if !band.len().is_multiple_of(self.row) || rows > left {
            return Err(self.refuse(&format!("{} bytes are not some of the {left} rows that are left", band.len())));
        }
        let Some(mut encoder) = self.encoder.take() else { return Err(self.refuse("an earlier band could not be written")) };
        let first = self.next;
        shielded(|| encoder.write(&self.like, first, band)).map_err(|fault| named(&self.target, fault))?;
        self.encoder = Some(encoder);
        self.next += rows;
        Ok(())
    }

    /// Ends the file and puts it in its place.
    ///
    /// Errors: rows are missing, or the file cannot be written.
    pub fn finish(mut self) -> Result<()> {
        let height = self.like.height as usize;
        let Some(encoder) = self.encoder.take() else { return Err(self.refuse("an earlier band could not be written")) };
        if self.next < height {
            return Err(self.refuse(&format!("it was to have {height} rows and has {}", self.next)));
        }
        let Self { target, like, .. } = self;
        let file = match encoder {
            Encoder::Whole { mut file, options, bytes } => {
                let picture = Picture { bytes, ..like };
                let mut out = BufWriter::with_capacity(1 << 20, &mut file);
                encode_to(&mut out, &target, &picture, &options)?;
                out.flush().map_err(|error| Error::write(&target, error))?;
                drop(out);
                file
            }
            by_rows => shielded(|| by_rows.finish()).map_err(|fault| named(&target, fault))?,
        };
        file.commit().map_err(|error| Error::write(&target, error))
    }

    fn refuse(&self, reason: &str) -> Error {
        Error::Form { file: self.target.to_string(), reason: reason.to_owned() }
    }
}

impl fmt::Debug for RowWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RowWriter").field("target", &self.target).field("next", &self.next).finish_non_exhaustive()
    }
}

impl Encoder {
    fn begin(file: AtomicFile, format: Format, like: &Picture, options: &WriteOptions) -> Result<Self, Fault> {
        let compression = compression_of(format, options)?;
        let tag = options.colorspace != Some(Colorspace::Raw);
        let buffered = |sink| BufWriter::with_capacity(1 << 20, sink);
        Ok(match format {
            Format::Exr => Self::Exr(exr::RowEncoder::begin(buffered(Sink::seeking(file)), like, compression, tag)?),
            Format::Tiff => Self::Tiff(tiff::Strips::begin(buffered(Sink::seeking(file)), like, compression)?),
            Format::Png | Format::Apng => {
                let file = Shared::new(file);
                Self::Png { encoder: png::RowEncoder::begin(file.clone(), like, compression, tag)?, file }
            }
            Format::Pfm => {
                let (mut out, head) = (buffered(Sink::seeking(file)), plain::pfm_head(like));
                out.write_all(&head).map_err(Fault::Io)?;
                Self::Pfm { out, head: head.len() as u64 }
            }
            Format::Npy => {
                let mut out = buffered(Sink::File(file));
                out.write_all(&plain::npy_head(like)).map_err(Fault::Io)?;
                Self::Npy(out)
            }
            Format::Jpeg | Format::WebP | Format::Hdr | Format::Qoi | Format::Gif => {
                Self::Whole { file, options: options.clone(), bytes: Vec::new() }
            }
        })
    }

    /// Appends a band that begins with row `first`.
    fn write(&mut self, like: &Picture, first: usize, band: &[u8]) -> Result<(), Fault> {
        let row = like.width as usize * like.channels.count() * like.sample.bytes();
        let rows = band.len() / row;
        match self {
            Self::Exr(encoder) => encoder.write(band, rows),
            Self::Png { encoder, .. } => encoder.write(band),
            Self::Tiff(strips) => strips.write(band),
            // Rows go from bottom to top.
            Self::Pfm { out, head } => {
                let below = like.height as usize - first - rows;
                out.seek(SeekFrom::Start(*head + (below * row) as u64)).map_err(Fault::Io)?;
                band.chunks_exact(row).rev().try_for_each(|line| out.write_all(line)).map_err(Fault::Io)
            }
            Self::Npy(out) => out.write_all(&plain::npy_rows(like.sample, band)).map_err(Fault::Io),
            Self::Whole { bytes, .. } => {
                bytes.extend_from_slice(band);
                Ok(())
            }
        }
    }

    /// Ends the file, which is ready to be put in its place.
    fn finish(self) -> Result<AtomicFile, Fault> {
        let out = match self {
            Self::Exr(encoder) => encoder.finish()?,
            Self::Tiff(strips) => strips.finish()?,
            Self::Pfm { out, .. } | Self::Npy(out) => out,
            Self::Png { encoder, file } => {
                encoder.finish()?;
                return Ok(file.into_file());
            }
            Self::Whole { file, .. } => return Ok(file),
        };
        out.into_inner().map_err(io::IntoInnerError::into_error).and_then(Sink::finish).map_err(Fault::Io)
    }
}

/// Where an encoder writes that goes back to fill in what it learns later. A stream cannot go back, so what is meant
/// for one is kept, compressed as it is.
enum Sink {
    File(AtomicFile),
    Kept { bytes: Cursor<Vec<u8>>, stream: AtomicFile },
}

impl Sink {
    fn seeking(file: AtomicFile) -> Self {
        if file.seeks() { Self::File(file) } else { Self::Kept { bytes: Cursor::default(), stream: file } }
    }

    fn finish(self) -> io::Result<AtomicFile> {
        match self {
            Self::File(file) => Ok(file),
            Self::Kept { bytes, mut stream } => {
                stream.write_all(bytes.get_ref())?;
                Ok(stream)
            }
        }
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Kept { bytes: kept, .. } => kept.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Kept { .. } => Ok(()),
        }
    }
}

impl Seek for Sink {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(to),
            Self::Kept { bytes, .. } => bytes.seek(to),
        }
    }
}
