//! Where a picture comes from and where it goes: paths, streams, formats, limits.
//!
//! A source's format is read off its first bytes and never off its name: files are renamed, and streams have no name.
//! A target has only its name. The whole file is read into memory once; planning (the header) and decoding then work
//! on the same bytes. (Bands of rows are read from the file as they are wanted: [`RowReader`](crate::RowReader).) Memory
//! mapping was rejected: it needs `unsafe`, a file that shrinks under it kills the process, and a decoder that reads
//! every byte once gains nothing.

use std::fmt;
use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::error::{BY_ROWS, Error, Fault, RAISE, Result};
use crate::volume::VolumeFormat;

/// A file format for images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// OpenEXR.
    Exr,
    /// Portable Network Graphics.
    Png,
    /// JPEG (JFIF, Exif).
    Jpeg,
    /// TIFF and BigTIFF.
    Tiff,
    /// Radiance RGBE.
    Hdr,
    /// Portable float map.
    Pfm,
    /// WebP.
    WebP,
    /// Quite OK Image.
    Qoi,
    /// NumPy array.
    Npy,
    /// Graphics Interchange Format: one picture or a moving one, of 256 colours each.
    Gif,
    /// Animated PNG: a moving picture; alone it is a PNG.
    Apng,
}

impl Format {
    /// Every format.
    pub const ALL: [Self; 11] =
        [Self::Exr, Self::Png, Self::Jpeg, Self::Tiff, Self::Hdr, Self::Pfm, Self::WebP, Self::Qoi, Self::Npy, Self::Gif, Self::Apng];

    /// The format's own name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exr => "EXR",
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Tiff => "TIFF",
            Self::Hdr => "Radiance HDR",
            Self::Pfm => "PFM",
            Self::WebP => "WebP",
            Self::Qoi => "QOI",
            Self::Npy => "NPY",
            Self::Gif => "GIF",
            Self::Apng => "APNG",
        }
    }

    /// Its extensions, the usual one first.
    pub const fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Exr => &["exr"],
            Self::Png => &["png"],
            Self::Jpeg => &["jpg", "jpeg"],
            Self::Tiff => &["tif", "tiff"],
            Self::Hdr => &["hdr", "rgbe"],
            Self::Pfm => &["pfm"],
            Self::WebP => &["webp"],
            Self::Qoi => &["qoi"],
            Self::Npy => &["npy"],
            Self::Gif => &["gif"],
            Self::Apng => &["apng"],
        }
    }

    /// The format that begins with these bytes (12 are enough).
    pub fn sniff(bytes: &[u8]) -> Option<Self> {
        const MAGIC: [(&[u8], Format); 14] = [
            (&[0x76, 0x2f, 0x31, 0x01], Format::Exr),
            (b"\x89PNG\r\n\x1a\n", Format::Png),
            (&[0xff, 0xd8, 0xff], Format::Jpeg),
            (b"II*\0", Format::Tiff),
            (b"MM\0*", Format::Tiff),
            (b"II+\0", Format::Tiff),
            (b"MM\0+", Format::Tiff),
            (b"#?RADIANCE", Format::Hdr),
            (b"#?RGBE", Format::Hdr),
            (b"PF", Format::Pfm),
            (b"Pf", Format::Pfm),
            (b"qoif", Format::Qoi),
            (b"GIF8", Format::Gif),
            (b"\x93NUMPY", Format::Npy),
        ];
        if bytes.len() >= 12 && bytes.starts_with(b"RIFF") && &bytes[8..12] == b"WEBP" {
            return Some(Self::WebP);
        }
        let (magic, format) = MAGIC.into_iter().find(|(magic, _)| bytes.starts_with(magic))?;
        // Two letters are little evidence: a PFM's are followed by white space.
        (format != Self::Pfm || bytes.get(magic.len()).is_some_and(u8::is_ascii_whitespace)).then_some(format)
    }

    /// Whether one file of this format can hold the frames of a sequence.
    pub const fn moves(self) -> bool {
        matches!(self, Self::Gif | Self::Apng)
    }

    /// Whether pictures of this format are read and written by bands of rows without being held whole.
    pub const fn by_rows(self) -> bool {
        matches!(self, Self::Exr | Self::Png | Self::Tiff | Self::Pfm | Self::Npy)
    }

    /// The format that a file name's extension stands for, in any case.
    pub fn of_extension(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.extensions().contains(&extension.as_str()))
    }

    pub(crate) fn known_names() -> String {
        Self::ALL.map(Self::name).join(", ")
    }

    pub(crate) fn known_extensions() -> String {
        Self::ALL.map(|format| format!(".{}", format.extensions()[0])).join(" ")
    }
}

/// How much of a picture is looked at, which is what has to be within the [`Limits`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Extent {
    /// All of it is decoded at once.
    Whole,
    /// Bands of rows are, whose size is checked when they are asked for.
    Rows,
}

impl Extent {
    /// How many of `height` rows are held before any is asked for: all, or one.
    pub(crate) fn rows(self, height: u64) -> u64 {
        match self {
            Self::Whole => height,
            Self::Rows => height.min(1),
        }
    }
}

/// How large a picture may be. Headers are checked against it before anything of the declared size is allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Pixels of the data and of the display window each; 2^28 (16384 × 16384) by default.
    pub max_pixels: u64,
    /// Bytes of the decoded picture, and of the file; 2^33 (8 GiB) by default.
    pub max_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_pixels: 1 << 28, max_bytes: 1 << 33 }
    }
}

impl Limits {
    /// Checks a declared size of which only some is held at once.
    pub(crate) fn check_extent(&self, extent: Extent, width: u64, height: u64, bytes_per_pixel: u64) -> Result<(), Fault> {
        self.check(width, extent.rows(height), bytes_per_pixel).map_err(|fault| match (fault, extent) {
            (Fault::TooLarge(_), Extent::Rows) => {
                let Self { max_pixels, max_bytes } = self;
                let limits = format!("the limits of {max_pixels} pixels (--max-pixels) and {max_bytes} bytes");
                Fault::TooLarge(format!("it declares {width}×{height} pixels, of which not even one row is within {limits}"))
            }
            (fault, _) => fault,
        })
    }

    /// Checks a declared size; `bytes_per_pixel` over all channels that will be held.
    pub(crate) fn check(&self, width: u64, height: u64, bytes_per_pixel: u64) -> Result<(), Fault> {
        if width == 0 || height == 0 {
            return Err(Fault::damaged(format!("it declares an empty picture ({width}×{height})")));
        }
        let pixels = u128::from(width) * u128::from(height);
        if pixels > u128::from(self.max_pixels) || width > u64::from(u32::MAX) || height > u64::from(u32::MAX) {
            let max = self.max_pixels;
            return Err(Fault::TooLarge(format!("it declares {width}×{height} pixels, more than the limit of {max} (--max-pixels)")));
        }
        let bytes = pixels * u128::from(bytes_per_pixel);
        if bytes > u128::from(self.max_bytes) || bytes > isize::MAX as u128 {
            let max = self.max_bytes;
            return Err(Fault::TooLarge(format!("it declares {bytes} bytes of pixels, more than the limit of {max} (--max-pixels)")));
        }
        Ok(())
    }
}

/// A place to read a picture from: `file`, `file.exr#layer`, or `-` for the standard input.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Source {
    /// The file; `None` is the standard input.
    pub path: Option<PathBuf>,
    /// The layer, part, view or channel after the `#`; the size and type of a raw volume.
    pub layer: Option<String>,
}

impl Source {
    /// Reads a source off the command line. The `#` that starts a layer's name follows a known extension
    /// (`in.####.exr#diffuse` has the layer `diffuse`, `in.####.exr` has none), so a `#` inside a file name is safe.
    pub fn parse(text: &str) -> Self {
        let at_known_extension = |at: usize| {
            let path = &text[..at];
            path == "-" || Format::of_extension(Path::new(path)).is_some() || VolumeFormat::of_name(Path::new(path)).is_some()
        };
        let split = text.match_indices('#').map(|(at, _)| at).find(|&at| at_known_extension(at));
        let (path, layer) = match split {
            Some(at) => (&text[..at], Some(text[at + 1..].to_owned()).filter(|layer| !layer.is_empty())),
            None => (text, None),
        };
        Self { path: (path != "-").then(|| PathBuf::from(path)), layer }
    }

    /// A whole file, no layer named.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self { path: Some(path.into()), layer: None }
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.path {
            Some(path) => write!(f, "{}", path.display())?,
            None => f.write_str("the standard input")?,
        }
        self.layer.as_ref().map_or(Ok(()), |layer| write!(f, "#{layer}"))
    }
}

/// A place to write to: a file, or `-` for the standard output (whose format must be said).
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Target {
    /// The file; `None` is the standard output.
    pub path: Option<PathBuf>,
    /// The format to write.
    pub format: Format,
}

impl Target {
    /// Reads a target off the command line: the extension chooses the format, a stream (`-`) is PNG unless it says
    /// otherwise as `-.exr`.
    pub fn parse(text: &str) -> Result<Self> {
        if text == "-" {
            return Ok(Self { path: None, format: Format::Png });
        }
        let path = PathBuf::from(text);
        let format = Format::of_extension(Path::new(text))
            .ok_or_else(|| Error::UnknownExtension { file: text.to_owned(), known: Format::known_extensions() })?;
        Ok(Self { path: (path.file_stem() != Some("-".as_ref())).then_some(path), format })
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.path {
            Some(path) => write!(f, "{}", path.display()),
            None => f.write_str("the standard output"),
        }
    }
}

/// Opens what can be read to its end: a file or a pipe.
pub(crate) fn open(source: &Source, path: &Path) -> Result<File> {
    let failed = |error: io::Error| Error::read(source, error);
    if is_device(&std::fs::metadata(path).map_err(failed)?) {
        return Err(Error::argument(source.to_string(), "a file or a pipe: it is a device"));
    }
    File::open(path).map_err(failed)
}

#[cfg(unix)]
fn is_device(about: &Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    about.file_type().is_char_device() || about.file_type().is_block_device()
}

#[cfg(not(unix))]
fn is_device(_: &Metadata) -> bool {
    false
}

/// Reads a whole file or stream, at most `limits.max_bytes` of it.
pub(crate) fn load(source: &Source, limits: &Limits) -> Result<Vec<u8>> {
    let failed = |error: io::Error| Error::read(source, error);
    let mut bytes = Vec::new();
    match &source.path {
        Some(path) => {
            let file = open(source, path)?;
            let length = file.metadata().map_err(failed)?.len();
            bytes.reserve(length.min(limits.max_bytes) as usize + 1);
            file.take(limits.max_bytes + 1).read_to_end(&mut bytes).map_err(failed)?;
        }
        None => {
            io::stdin().lock().take(limits.max_bytes + 1).read_to_end(&mut bytes).map_err(failed)?;
        }
    }
    if bytes.len() as u64 > limits.max_bytes {
        let reason = format!("it has more than {} bytes", limits.max_bytes);
        let by_rows = source.path.as_deref().and_then(Format::of_extension).is_some_and(Format::by_rows);
        return Err(Error::TooLarge { file: source.to_string(), reason, advice: if by_rows { BY_ROWS } else { RAISE } });
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layer_follows_an_extension() {
        let parts = |text: &str| {
            let source = Source::parse(text);
            (source.path.map(|path| path.display().to_string()), source.layer)
        };
        let path = |text: &str| Some(text.to_owned());
        assert_eq!(parts("in.exr"), (path("in.exr"), None));
        assert_eq!(parts("in.exr#diffuse"), (path("in.exr"), path("diffuse")));
        assert_eq!(parts("in.####.exr"), (path("in.####.exr"), None));
        assert_eq!(parts("in.####.EXR#left.N"), (path("in.####.EXR"), path("left.N")));
        assert_eq!(parts("a#b"), (path("a#b"), None));
        assert_eq!(parts("fog.raw#9x8x7:u8"), (path("fog.raw"), path("9x8x7:u8")));
        assert_eq!(parts("fmri.nii.gz#3"), (path("fmri.nii.gz"), path("3")));
        assert_eq!(parts("-"), (None, None));
        assert_eq!(parts("-#Z"), (None, path("Z")));
    }

    #[test]
    fn targets_know_their_format() {
        assert_eq!(Target::parse("a/b.TIFF").unwrap().format, Format::Tiff);
        assert_eq!(Target::parse("-.exr").unwrap(), Target { path: None, format: Format::Exr });
        assert!(Target::parse("picture").unwrap_err().to_string().contains(".exr"));
    }

    #[test]
    fn two_letters_are_not_yet_a_pfm() {
        assert_eq!(Format::sniff(b"PF\n2 2\n"), Some(Format::Pfm));
        assert_eq!(Format::sniff(b"PFooo"), None);
    }
}
