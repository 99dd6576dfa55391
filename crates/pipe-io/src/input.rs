//! Reading: one door to all decoders.

use std::io::Read;

use crate::colour::Colorspace;
use crate::error::{Error, Fault, Result};
use crate::guard::shielded;
use crate::picture::{Header, Picture};
use crate::source::{Format, Limits, Source, load, open};
use crate::{exr, plain, png, raster, tiff};

/// How to read.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadOptions {
    /// What is too large.
    pub limits: Limits,
    /// `--in-colorspace`: what the values mean, whatever the file says. `None` believes the file, and takes integers
    /// without a word for sRGB and floats for linear Rec.709.
    pub colorspace: Option<Colorspace>,
}

/// A file in memory whose format is known. Planning asks it for the header, execution for the picture; the file (or
/// stream, which could not be read twice) is loaded once.
#[derive(Debug)]
pub struct Input {
    source: Source,
    format: Format,
    options: ReadOptions,
    bytes: Vec<u8>,
}

impl Input {
    /// Loads a file or stream and recognises its format by its first bytes.
    ///
    /// Errors: it cannot be read, is larger than `options.limits.max_bytes`, or is of no known format.
    pub fn open(source: &Source, options: &ReadOptions) -> Result<Self> {
        Self::from_bytes(source, load(source, &options.limits)?, options)
    }

    /// The same for bytes that are in memory already; `source` gives the name for messages and the layer.
    pub fn from_bytes(source: &Source, bytes: Vec<u8>, options: &ReadOptions) -> Result<Self> {
        let format = recognise(source, &bytes)?;
        Ok(Self { source: source.clone(), format, options: *options, bytes })
    }

    /// The format.
    pub fn format(&self) -> Format {
        self.format
    }

    /// What the header says; no pixels are decoded.
    pub fn header(&self) -> Result<Header> {
        self.examine(self.bytes.len() as u64)
    }

    /// Decodes the picture.
    pub fn read(&self) -> Result<Picture> {
        let (bytes, limits) = (self.bytes.as_slice(), &self.options.limits);
        let profiles = self.options.colorspace.is_none();
        let layer = self.layer()?;
        let decoded = shielded(|| match self.format {
            Format::Exr => exr::decode(bytes, layer, limits),
            Format::Png | Format::Apng => png::decode(bytes, limits, profiles),
            Format::Tiff => tiff::decode(bytes, limits, profiles),
            Format::Jpeg | Format::WebP | Format::Hdr | Format::Qoi | Format::Gif => raster::decode(self.format, bytes, limits, profiles),
            Format::Pfm => plain::pfm_decode(bytes, limits),
            Format::Npy => plain::npy_decode(bytes, limits),
        });
        let mut picture = decoded.map_err(|fault| self.name(fault))?;
        if let Some(space) = self.options.colorspace {
            picture.colour = space.colour();
        }
        Ok(picture)
    }

    fn examine(&self, length: u64) -> Result<Header> {
        let (bytes, limits) = (self.bytes.as_slice(), &self.options.limits);
        let profiles = self.options.colorspace.is_none();
        let layer = self.layer()?;
        let header = shielded(|| match self.format {
            Format::Exr => exr::header(bytes, length, layer, limits),
            Format::Png | Format::Apng => png::header(bytes, limits, profiles),
            Format::Tiff => tiff::header(bytes, limits, profiles),
            Format::Jpeg | Format::WebP | Format::Hdr | Format::Qoi | Format::Gif => raster::header(self.format, bytes, limits, profiles),
            Format::Pfm => plain::pfm_header(bytes, limits),
            Format::Npy => plain::npy_header(bytes, limits),
        });
        let mut header = header.map_err(|fault| self.name(fault))?;
        if let Some(space) = self.options.colorspace {
            header.colour = space.colour();
        }
        Ok(header)
    }

    /// The layer asked for; only EXR has any.
    fn layer(&self) -> Result<Option<&str>> {
        match self.source.layer.as_deref() {
            Some(wanted) if self.format != Format::Exr => {
                let available = format!("none, being a {} file", self.format.name());
                Err(self.name(Fault::NoSuchLayer { wanted: wanted.to_owned(), available }))
            }
            layer => Ok(layer),
        }
    }

    fn name(&self, fault: Fault) -> Error {
        let file = Source { layer: None, ..self.source.clone() };
        fault.of(file, self.format)
    }
}

/// What the header of a file says. Reads the beginning of the file, and the rest only where that does not suffice
/// (TIFF keeps its directory at the end). The standard input cannot be read twice: use [`Input`] for it.
pub fn probe(source: &Source, options: &ReadOptions) -> Result<Header> {
    const BEGINNING: u64 = 1 << 18;
    if let Some(path) = &source.path {
        let failed = |error| Error::read(source, error);
        let mut file = open(source, path)?;
        let length = file.metadata().map_err(failed)?.len();
        if length > BEGINNING {
            let mut bytes = Vec::new();
            file.by_ref().take(BEGINNING).read_to_end(&mut bytes).map_err(failed)?;
            let beginning = Input::from_bytes(source, bytes, options)?;
            match beginning.examine(length) {
                // Being cut off looks like damage; whether it is one shows in the whole file.
                Err(Error::Damaged { .. } | Error::Unsupported { .. }) => {}
                header => return header,
            }
        }
    }
    Input::open(source, options)?.header()
}

/// Reads a picture from a file or the standard input.
pub fn read(source: &Source, options: &ReadOptions) -> Result<Picture> {
    Input::open(source, options)?.read()
}

fn recognise(source: &Source, bytes: &[u8]) -> Result<Format> {
    Format::sniff(bytes).ok_or_else(|| match bytes {
        [] => Error::Damaged {
            file: source.to_string(),
            format: source.path.as_deref().and_then(Format::of_extension).map_or("image", Format::name),
            reason: "it is empty".to_owned(),
        },
        _ => Error::UnknownFormat { file: source.to_string(), what: "image", known: Format::known_names() },
    })
}
