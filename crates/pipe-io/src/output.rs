//! Writing: one door to all encoders.

use std::io::{BufWriter, Cursor, Write};

use crate::atomic::AtomicFile;
use crate::colour::Colorspace;
use crate::error::{Error, Fault, Result};
use crate::form::{WriteOptions, compression_of, output_form};
use crate::guard::shielded;
use crate::picture::Picture;
use crate::source::{Format, Target};
use crate::{exr, plain, png, raster, tiff};

/// Writes a picture that is in the form [`output_form`] asked for. The file appears under its name only when it is
/// complete; on an error an earlier file of that name is untouched.
///
/// Errors: the picture is not in that form, or the file cannot be written.
pub fn write(target: &Target, picture: &Picture, options: &WriteOptions) -> Result<()> {
    check(target, picture, options)?;
    let failed = |error| Error::write(target, error);
    let mut file = AtomicFile::create(target.path.as_deref()).map_err(failed)?;
    let mut out = BufWriter::with_capacity(1 << 20, &mut file);
    encode_to(&mut out, target, picture, options)?;
    out.flush().map_err(failed)?;
    drop(out);
    file.commit().map_err(failed)
}

/// Encodes a picture into memory, as [`write`] would into a file.
pub fn encode(target: &Target, picture: &Picture, options: &WriteOptions) -> Result<Vec<u8>> {
    check(target, picture, options)?;
    let mut bytes = Vec::new();
    encode_to(&mut bytes, target, picture, options)?;
    Ok(bytes)
}

pub(crate) fn encode_to(out: &mut dyn Write, target: &Target, picture: &Picture, options: &WriteOptions) -> Result<()> {
    let tag = options.colorspace != Some(Colorspace::Raw);
    let format = target.format;
    shielded(|| {
        let compression = compression_of(format, options)?;
        // These encoders seek, which a stream cannot: they write into memory first.
        let mut seekable = Cursor::new(Vec::new());
        match format {
            Format::Exr => return exr::encode(out, picture, compression, tag),
            Format::Png | Format::Apng => return png::encode(out, picture, compression, tag),
            Format::Pfm => return plain::pfm_encode(out, picture),
            Format::Npy => return plain::npy_encode(out, picture),
            Format::Tiff => tiff::encode(&mut seekable, picture, compression)?,
            Format::Jpeg | Format::WebP | Format::Hdr | Format::Qoi | Format::Gif => {
                raster::encode(format, &mut seekable, picture, options.quality)?;
            }
        }
        out.write_all(seekable.get_ref()).map_err(Fault::Io)
    })
    .map_err(|fault| named(target, fault))
}

/// What an encoder has to say about the file that it was to write.
pub(crate) fn named(target: &Target, fault: Fault) -> Error {
    match fault {
        // An encoder that gives up has met a picture it cannot hold, not a damaged file.
        Fault::Damaged(reason) => Fault::Form(reason).of(target, target.format),
        other => other.of(target, target.format),
    }
}

/// Checks that the picture is whole and in the form that its target wants.
pub(crate) fn check(target: &Target, picture: &Picture, options: &WriteOptions) -> Result<()> {
    let refuse = |reason: String| Error::Form { file: target.to_string(), reason };
    let expected = Picture::byte_count(picture.width, picture.height, picture.channels, picture.sample);
    if expected != Some(picture.bytes.len()) {
        let (w, h, bytes) = (picture.width, picture.height, picture.bytes.len());
        return Err(refuse(format!("{bytes} bytes are no picture of {w}×{h} pixels")));
    }
    check_form(target, picture, options)
}

/// The same for a picture whose pixels are not there yet.
pub(crate) fn check_form(target: &Target, picture: &Picture, options: &WriteOptions) -> Result<()> {
    let refuse = |reason: String| Error::Form { file: target.to_string(), reason };
    if picture.width == 0 || picture.height == 0 {
        let (w, h) = (picture.width, picture.height);
        return Err(refuse(format!("{w}×{h} pixels are no picture")));
    }
    let largest = match target.format {
        Format::Jpeg | Format::Gif => 65_535,
        Format::WebP => 16_383,
        _ => i32::MAX as u32,
    };
    if picture.width.max(picture.height) > largest {
        let (name, w, h) = (target.format.name(), picture.width, picture.height);
        return Err(refuse(format!("{name} holds at most {largest} pixels a side, not {w}×{h}; write EXR or PNG")));
    }
    let asked = WriteOptions { pixel_type: Some(picture.sample), channels: Some(picture.channels), ..options.clone() };
    let form = output_form(target, &asked, None)?;
    if (form.layout, form.channels) != (picture.layout, picture.channels) {
        let (want, have) = ((form.channels, form.layout), (picture.channels, picture.layout));
        return Err(refuse(format!("it wants its pixels as {want:?}, not as {have:?}")));
    }
    Ok(())
}
