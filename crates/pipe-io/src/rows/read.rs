//! A picture's rows out of a file.

use std::fmt;
use std::fs::File;
use std::io::{Read, Seek};
use std::ops::Range;

use super::{Rows, Streamed, zeroed};
use crate::error::{Error, Fault, Result};
use crate::guard::shielded;
use crate::icc;
use crate::input::{Input, ReadOptions, probe, read};
use crate::picture::{Header, Layout, Picture};
use crate::source::{Format, Source};
use crate::{exr, plain, png, tiff};

/// A file whose picture is read by bands of rows.
///
/// ```no_run
/// use pipe_io::{ReadOptions, RowReader, Source};
///
/// let mut reader = RowReader::open(&Source::file("mosaic.exr"), &ReadOptions::default())?;
/// let mut band = Vec::new();
/// for top in (0..reader.header().height).step_by(256) {
///     reader.read(top..reader.header().height.min(top + 256), &mut band)?;
/// }
/// # Ok::<(), pipe_io::Error>(())
/// ```
pub struct RowReader {
    source: Source,
    options: ReadOptions,
    header: Header,
    layout: Layout,
    pixels: Pixels,
}

/// Where bands come from.
enum Pixels {
    /// The file, as they are wanted.
    Streamed { rows: Box<dyn Rows>, conversion: Option<Conversion> },
    /// The picture, which is decoded when its first row is wanted.
    Whole { input: Option<Input>, picture: Option<Picture> },
}

/// What an ICC profile does to a band.
struct Conversion {
    profile: Vec<u8>,
    /// The picture before.
    before: Header,
}

impl RowReader {
    /// Reads the header of a file. The standard input, which cannot be read twice, is loaded.
    ///
    /// A picture may be larger than `options.limits` where its format is read by rows ([`Format::by_rows`]); they then
    /// hold for each band.
    pub fn open(source: &Source, options: &ReadOptions) -> Result<Self> {
        let Some(file) = regular(source)? else {
            let input = Input::open(source, options)?;
            return Ok(Self::whole(source, options, input.header()?, Some(input)));
        };
        let (file, format) = file;
        let streamed = match format {
            Some(format) => shielded(|| open(file, format, source, options)).map_err(|fault| named(source, format, fault))?,
            None => None,
        };
        match streamed {
            Some(streamed) => Ok(Self::streaming(source, options, streamed)),
            None => Ok(Self::whole(source, options, probe(source, options).map_err(not_by_rows)?, None)),
        }
    }

    fn streaming(source: &Source, options: &ReadOptions, streamed: Streamed) -> Self {
        let Streamed { header: before, layout, profile, rows } = streamed;
        let mut header = before.clone();
        header.apply_profile(profile.as_deref());
        if let Some(space) = options.colorspace {
            header.colour = space.colour();
        }
        let converted = (header.sample, header.channels) != (before.sample, before.channels);
        let conversion = profile.filter(|_| converted).map(|profile| Conversion { profile, before });
        Self { source: source.clone(), options: *options, header, layout, pixels: Pixels::Streamed { rows, conversion } }
    }

    fn whole(source: &Source, options: &ReadOptions, header: Header, input: Option<Input>) -> Self {
        let layout = if header.format == Format::Exr { Layout::Planar } else { Layout::Interleaved };
        Self { source: source.clone(), options: *options, header, layout, pixels: Pixels::Whole { input, picture: None } }
    }

    /// What the file says about the whole picture.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// In which order the samples of a band follow each other.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// Decodes rows into `band`, whose memory is used again: `width · rows · channels · sample` bytes, just as a
    /// picture of these rows alone has them. Any rows at any time; going back costs a PNG to begin from the top, save
    /// for a few rows by which bands overlap.
    ///
    /// Errors: the file is damaged there, or a band of so many rows is beyond the limits.
    ///
    /// # Panics
    ///
    /// Where the rows are not in the picture.
    pub fn read(&mut self, rows: Range<u32>, band: &mut Vec<u8>) -> Result<()> {
        assert!(rows.start <= rows.end && rows.end <= self.header.height, "no rows {rows:?} in a picture of {}", self.header.height);
        if rows.is_empty() {
            band.clear();
            return Ok(());
        }
        let length = self.band_bytes(&self.header, &rows)?;
        let wanted = rows.start as usize..rows.end as usize;
        match &mut self.pixels {
            Pixels::Whole { input, picture } => {
                let picture = match picture {
                    Some(picture) => picture,
                    None => {
                        let decoded = input.as_ref().map_or_else(|| read(&self.source, &self.options), Input::read);
                        *input = None;
                        picture.insert(decoded.map_err(not_by_rows)?)
                    }
                };
                let row = picture.bytes.len()
                    / picture.height as usize
                    / if self.layout == Layout::Planar { picture.channels.count() } else { 1 };
                *band = zeroed(std::mem::take(band), length);
                let planes = picture.bytes.chunks_exact(row * picture.height as usize);
                for (plane, target) in planes.zip(band.chunks_exact_mut(row * wanted.len())) {
                    target.copy_from_slice(&plane[wanted.start * row..wanted.end * row]);
                }
                Ok(())
            }
            Pixels::Streamed { rows: decoder, conversion: None } => {
                *band = zeroed(std::mem::take(band), length);
                shielded(|| decoder.read(wanted, band)).map_err(|fault| named(&self.source, self.header.format, fault))
            }
            Pixels::Streamed { rows: decoder, conversion: Some(Conversion { profile, before }) } => {
                let pixel = before.channels.count() * before.sample.bytes();
                let about = Header { height: rows.end - rows.start, ..before.clone() };
                let converted = shielded(|| {
                    let mut raw = vec![0; about.width as usize * wanted.len() * pixel];
                    decoder.read(wanted, &mut raw)?;
                    icc::apply(Some(profile), about.picture(self.layout, raw))
                });
                *band = converted.map_err(|fault| named(&self.source, self.header.format, fault))?.bytes;
                Ok(())
            }
        }
    }

    /// The size of a band, if it is within the limits.
    fn band_bytes(&self, about: &Header, rows: &Range<u32>) -> Result<usize> {
        let count = rows.end - rows.start;
        let pixel = about.channels.count() * about.sample.bytes();
        let checked = self.options.limits.check(about.width.into(), count.into(), pixel as u64);
        match checked {
            Ok(()) => Ok(about.width as usize * count as usize * pixel),
            Err(Fault::TooLarge(reason)) => {
                let reason = format!("a band of {count} rows: {reason}");
                Err(Error::TooLarge { file: self.source.to_string(), reason, advice: "ask for fewer rows at once, or raise the limit" })
            }
            Err(other) => Err(named(&self.source, about.format, other)),
        }
    }
}

/// Opens a file whose format is read by rows; `None` where this format, or this kind of it, is not.
fn open(file: File, format: Format, source: &Source, options: &ReadOptions) -> Result<Option<Streamed>, Fault> {
    let (limits, profiles) = (&options.limits, options.colorspace.is_none());
    match (format, source.layer.as_deref()) {
        (Format::Exr, layer) => exr::open_rows(file, layer, limits),
        (Format::Png, None) => png::open_rows(file, limits, profiles),
        (Format::Tiff, None) => tiff::open_rows(file, limits, profiles),
        (Format::Pfm, None) => plain::pfm_open_rows(file, limits),
        (Format::Npy, None) => plain::npy_open_rows(file, limits),
        _ => Ok(None),
    }
}

fn named(source: &Source, format: Format, fault: Fault) -> Error {
    fault.of(Source { layer: None, ..source.clone() }, format)
}

/// Who reads by rows already needs other advice.
fn not_by_rows(error: Error) -> Error {
    match error {
        Error::TooLarge { file, reason, .. } => {
            let advice = "only EXR without subsampled chroma, PNG without interlacing, upright TIFF, PFM and NPY are read by bands of rows: \
                          convert it to one of these, or raise the limit";
            Error::TooLarge { file, reason, advice }
        }
        other => other,
    }
}

impl fmt::Debug for RowReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RowReader").field("source", &self.source).field("header", &self.header).finish_non_exhaustive()
    }
}

/// The file, where it is one on disk, and its format.
fn regular(source: &Source) -> Result<Option<(File, Option<Format>)>> {
    let Some(path) = &source.path else { return Ok(None) };
    let failed = |error| Error::read(source, error);
    if !std::fs::metadata(path).map_err(failed)?.is_file() {
        return Ok(None);
    }
    let mut file = File::open(path).map_err(failed)?;
    let mut beginning = Vec::new();
    file.by_ref().take(64).read_to_end(&mut beginning).map_err(failed)?;
    file.rewind().map_err(failed)?;
    Ok(Some((file, Format::sniff(&beginning))))
}
