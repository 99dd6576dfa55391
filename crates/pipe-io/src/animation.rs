//! Moving pictures: the frames of a sequence in one file, APNG or GIF.

use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame, RgbaImage};

use crate::atomic::{AtomicFile, Shared};
use crate::colour::Colorspace;
use crate::error::{Error, Fault, Result};
use crate::form::{WriteOptions, compression_of};
use crate::output::check;
use crate::picture::{Channels, Picture};
use crate::png;
use crate::source::{Format, Target};

/// How thoroughly the 256 colours of a GIF frame are chosen, 1 (best) to 30.
const GIF_SPEED: i32 = 10;

/// A moving picture that is being written, for ever repeated when it is shown. Dropped before
/// [`finish`](Self::finish) it leaves nothing behind.
pub struct Animation {
    target: Target,
    options: WriteOptions,
    /// Frames of an APNG stand in its header.
    frames: u32,
    /// Frames a second.
    rate: f64,
    file: Shared,
    encoder: Option<Encoder>,
    written: u32,
}

enum Encoder {
    Apng(::png::Writer<Shared>),
    Gif(Box<GifEncoder<Shared>>),
}

impl Animation {
    /// Begins a file of so many frames, shown at `rate` frames a second.
    ///
    /// Errors: the format of the target does not [move](Format::moves), or the file cannot be created.
    pub fn create(target: &Target, frames: u32, rate: f64, options: &WriteOptions) -> Result<Self> {
        if !target.format.moves() {
            return Err(Error::Form { file: target.to_string(), reason: format!("{} holds one picture", target.format.name()) });
        }
        let file = AtomicFile::create(target.path.as_deref()).map_err(|error| Error::write(target, error))?;
        Ok(Self { target: target.clone(), options: options.clone(), frames, rate, file: Shared::new(file), encoder: None, written: 0 })
    }

    /// Appends a frame in the form that [`output_form`](crate::output_form) asked for. All frames have one size.
    pub fn push(&mut self, picture: &Picture) -> Result<()> {
        let options = WriteOptions { channels: Some(picture.channels), ..self.options.clone() };
        check(&self.target, picture, &options)?;
        self.append(picture).map_err(|fault| fault.of(&self.target, self.target.format))?;
        self.written += 1;
        Ok(())
    }

    fn append(&mut self, picture: &Picture) -> Result<(), Fault> {
        let encoder = match self.encoder.take() {
            Some(encoder) => encoder,
            None => self.open(picture)?,
        };
        match self.encoder.insert(encoder) {
            Encoder::Apng(writer) => png::put(writer, picture),
            Encoder::Gif(encoder) => {
                let frame = Frame::from_parts(opaque(picture)?, 0, 0, Delay::from_numer_denom_ms((1e6 / self.rate) as u32, 1000));
                encoder.encode_frame(frame).map_err(|error| Fault::Form(error.to_string()))
            }
        }
    }

    fn open(&self, first: &Picture) -> Result<Encoder, Fault> {
        if self.target.format == Format::Gif {
            let mut encoder = GifEncoder::new_with_speed(self.file.clone(), GIF_SPEED);
            encoder.set_repeat(Repeat::Infinite).map_err(|error| Fault::Form(error.to_string()))?;
            return Ok(Encoder::Gif(Box::new(encoder)));
        }
        let tag = self.options.colorspace != Some(Colorspace::Raw);
        let mut encoder = png::encoder(self.file.clone(), first, compression_of(Format::Apng, &self.options)?, tag);
        encoder.set_animated(self.frames, 0).map_err(png::failure)?;
        let thousandths = (self.rate * 1000.0).round().clamp(1.0, 65535.0 * 1000.0);
        let (over, under) = if thousandths <= 65535.0 { (1000, thousandths as u16) } else { (1, self.rate as u16) };
        encoder.set_frame_delay(over, under).map_err(png::failure)?;
        encoder.write_header().map_err(png::failure).map(Encoder::Apng)
    }

    /// Ends the file and puts it in its place.
    ///
    /// Errors: an APNG has fewer frames than were announced.
    pub fn finish(mut self) -> Result<()> {
        if self.target.format == Format::Apng && self.written != self.frames {
            let reason = format!("it was to have {} frames and has {}; write a GIF, or a file for each frame", self.frames, self.written);
            return Err(Error::Form { file: self.target.to_string(), reason });
        }
        if let Some(Encoder::Apng(writer)) = self.encoder.take() {
            writer.finish().map_err(|error| png::failure(error).of(&self.target, self.target.format))?;
        }
        self.file.into_file().commit().map_err(|error| Error::write(&self.target, error))
    }
}

/// The pixels with alpha, as the GIF encoder takes them.
fn opaque(picture: &Picture) -> Result<RgbaImage, Fault> {
    let bytes = match picture.channels {
        Channels::Rgba => picture.bytes.clone(),
        _ => picture.bytes.as_chunks::<3>().0.iter().flat_map(|[r, g, b]| [*r, *g, *b, 255]).collect(),
    };
    RgbaImage::from_raw(picture.width, picture.height, bytes).ok_or_else(|| Fault::Form("its frames differ in size".to_owned()))
}
