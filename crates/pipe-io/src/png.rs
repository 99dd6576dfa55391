//! PNG: all colour types and bit depths in; grey, grey + alpha, RGB, RGBA at 8 and 16 bits out.
//!
//! The default for writing is `png`'s Fastest (fdeflate behind a fixed filter): about 240 Mpx/s against 14 for
//! Balanced, and a preview or a frame of a sequence is written far more often than it is stored for good.

use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Seek, Write};
use std::ops::Range;

use crate::colour::{Colour, Primaries, Transfer};
use crate::error::Fault;
use crate::form::Compression;
use crate::icc;
use crate::picture::{Alpha, Channels, Header, Layout, Metadata, Picture, Sample};
use crate::rows::{Kept, Rows, Streamed};
use crate::source::{Extent, Format, Limits};

fn open<R: BufRead + Seek>(file: R, limits: &Limits, extent: Extent) -> Result<(png::Reader<R>, Header), Fault> {
    let memory = png::Limits { bytes: limits.max_bytes as usize };
    let mut decoder = png::Decoder::new_with_limits(file, memory);
    decoder.set_transformations(png::Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    let info = decoder.read_header_info().map_err(fault)?;
    limits.check_extent(extent, info.width.into(), info.height.into(), 8)?;
    let reader = decoder.read_info().map_err(fault)?;
    let info = reader.info();
    let (kind, depth) = reader.output_color_type();
    let channels = match kind {
        png::ColorType::Grayscale => Channels::Y,
        png::ColorType::GrayscaleAlpha => Channels::Ya,
        png::ColorType::Rgb | png::ColorType::Indexed => Channels::Rgb,
        png::ColorType::Rgba => Channels::Rgba,
    };
    let sample = if depth == png::BitDepth::Sixteen { Sample::U16 } else { Sample::U8 };
    let header = Header {
        format: Format::Png,
        width: info.width,
        height: info.height,
        sample,
        channels,
        alpha: if channels.has_alpha() { Alpha::Straight } else { Alpha::None },
        colour: colour(info),
        channel_names: Vec::new(),
        layers: Vec::new(),
        metadata: Metadata { sample: Some(sample), had_alpha: channels.has_alpha(), ..Metadata::default() },
    };
    Ok((reader, header))
}

pub(crate) fn header(bytes: &[u8], limits: &Limits, profiles: bool) -> Result<Header, Fault> {
    let (reader, mut header) = open(Cursor::new(bytes), limits, Extent::Whole)?;
    header.apply_profile(profile(reader.info()).filter(|_| profiles));
    Ok(header)
}

/// The ICC profile, where nothing in the file outranks it.
fn profile<'a>(info: &'a png::Info<'_>) -> Option<&'a [u8]> {
    info.icc_profile.as_deref().filter(|_| cicp(info).is_none())
}

pub(crate) fn decode(bytes: &[u8], limits: &Limits, profiles: bool) -> Result<Picture, Fault> {
    let (mut reader, header) = open(Cursor::new(bytes), limits, Extent::Whole)?;
    let size = reader.output_buffer_size().ok_or_else(|| Fault::damaged("its size overflows"))?;
    let mut pixels = vec![0; size];
    reader.next_frame(&mut pixels).map_err(fault)?;
    if header.sample == Sample::U16 {
        swap_to_native(&mut pixels);
    }
    icc::apply(profile(reader.info()).filter(|_| profiles), header.picture(Layout::Interleaved, pixels))
}

/// Reads the header of a file on disk; `None` where it is interlaced, so that its first row is complete only with its
/// last.
pub(crate) fn open_rows(file: File, limits: &Limits, profiles: bool) -> Result<Option<Streamed>, Fault> {
    let begin = file.try_clone().map_err(Fault::Read)?;
    let (reader, header) = open(BufReader::new(file), limits, Extent::Rows)?;
    if reader.info().interlaced {
        return Ok(None);
    }
    let profile = profile(reader.info()).filter(|_| profiles).map(<[u8]>::to_vec);
    let row = header.width as usize * header.channels.count() * header.sample.bytes();
    let (height, wide) = (header.height as usize, header.sample == Sample::U16);
    let rows =
        PngRows { file: begin, limits: *limits, reader: Some(reader), next: 0, height, row, wide, kept: Kept::default(), overlap: 64 };
    Ok(Some(Streamed { header, layout: Layout::Interleaved, profile, rows: Box::new(rows) }))
}

/// A file that is decoded from top to bottom, as often as need be.
struct PngRows {
    /// To begin anew.
    file: File,
    limits: Limits,
    /// `None` after an error.
    reader: Option<png::Reader<BufReader<File>>>,
    /// The row that the reader gives next.
    next: usize,
    height: usize,
    /// Bytes of a row.
    row: usize,
    /// Whether samples have two bytes.
    wide: bool,
    /// The last rows that were decoded.
    kept: Kept,
    /// How many are kept, which is as many as bands were seen to overlap by.
    overlap: usize,
}

impl PngRows {
    fn begin(&mut self) -> Result<(), Fault> {
        let mut file = self.file.try_clone().map_err(Fault::Read)?;
        file.rewind().map_err(Fault::Read)?;
        self.reader = Some(open(BufReader::new(file), &self.limits, Extent::Rows)?.0);
        self.next = 0;
        Ok(())
    }

    /// Decodes the next rows into `into`.
    fn decode(&mut self, into: &mut [u8]) -> Result<(), Fault> {
        let mut reader = self.reader.take().ok_or_else(|| Fault::damaged("it ends too early"))?;
        for row in into.chunks_exact_mut(self.row) {
            reader.read_row(row).map_err(fault)?;
            if self.wide {
                swap_to_native(row);
            }
            self.next += 1;
        }
        if self.next == self.height {
            // What follows the last row is checked too.
            reader.read_row(&mut []).map_err(fault)?;
        }
        self.reader = Some(reader);
        Ok(())
    }

    /// Keeps the last of these rows, and of those before them, for the next band.
    fn keep(&mut self, rows: Range<usize>, bytes: &[u8]) {
        let adjoining = self.kept.rows().end == rows.start;
        let before = if adjoining { self.kept.rows() } else { rows.start..rows.start };
        let mut kept = self.kept.take();
        if !adjoining {
            kept.clear();
        }
        let start = rows.end.saturating_sub(self.overlap).max(before.start);
        kept.drain(..(start.min(before.end) - before.start) * self.row);
        kept.extend_from_slice(&bytes[start.saturating_sub(rows.start) * self.row..]);
        self.kept = Kept::new(start..rows.end, kept);
    }
}

impl Rows for PngRows {
    fn read(&mut self, rows: Range<usize>, into: &mut [u8]) -> Result<(), Fault> {
        let rest = self.kept.copy_beginning(&rows, self.row, into);
        if rest.is_empty() {
            return Ok(());
        }
        if rest.start < self.next || self.reader.is_none() {
            // A band that goes further, but begins in rows which are gone: the next ones will too.
            if rows.end > self.next {
                self.overlap = self.overlap.max(self.next.saturating_sub(rows.start));
            }
            self.begin()?;
        }
        let mut skipped = vec![0; self.row];
        while self.next < rest.start {
            self.decode(&mut skipped)?;
        }
        let fresh = &mut into[(rest.start - rows.start) * self.row..];
        self.decode(fresh)?;
        self.keep(rest, fresh);
        Ok(())
    }
}

/// The meaning of the values by the chunks of the file, most exact first (PNG 3, section 4.3); ICC comes later.
fn colour(info: &png::Info<'_>) -> Colour {
    if let Some(colour) = cicp(info) {
        return colour;
    }
    if info.srgb.is_some() {
        return Colour::SRGB;
    }
    let gamma = info.gama_chunk.map(png::ScaledFloat::into_value).filter(|&gamma| gamma > 0.0);
    let transfer = match gamma {
        None => Transfer::Srgb,
        Some(gamma) if (gamma - 1.0).abs() < 1e-3 => Transfer::Linear,
        // Writers that mean sRGB say 1/2.2 for readers that know no better; the sRGB chunk, where present, won above.
        Some(gamma) => Transfer::Gamma(1.0 / gamma),
    };
    let primaries = info.chrm_chunk.map_or(Primaries::REC709, |xy| {
        let point = |(x, y): (png::ScaledFloat, png::ScaledFloat)| [x, y].map(|value| f64::from(value.into_value()));
        let primaries = Primaries { red: point(xy.red), green: point(xy.green), blue: point(xy.blue), white: point(xy.white) };
        if primaries.to_xyz().is_some() { primaries.snapped() } else { Primaries::REC709 }
    });
    Colour { primaries, transfer }
}

/// The cICP chunk (ITU-T H.273), as far as its transfer is one of ours.
fn cicp(info: &png::Info<'_>) -> Option<Colour> {
    let code = info.coding_independent_code_points.as_ref()?;
    let primaries = match code.color_primaries {
        1 => Primaries::REC709,
        9 => Primaries::REC2020,
        12 => Primaries::P3,
        _ => return None,
    };
    let transfer = match code.transfer_function {
        4 => Transfer::Gamma(2.2),
        8 => Transfer::Linear,
        13 => Transfer::Srgb,
        _ => return None,
    };
    Some(Colour { primaries, transfer })
}

pub(crate) fn encode(out: &mut dyn Write, picture: &Picture, compression: Compression, tag_colour: bool) -> Result<(), Fault> {
    let mut writer = encoder(out, picture, compression, tag_colour).write_header().map_err(failure)?;
    put(&mut writer, picture)?;
    writer.finish().map_err(failure)
}

/// An encoder for pictures like this one.
pub(crate) fn encoder<W: Write>(out: W, picture: &Picture, compression: Compression, tag_colour: bool) -> png::Encoder<'static, W> {
    let mut encoder = png::Encoder::new(out, picture.width, picture.height);
    encoder.set_color(match picture.channels {
        Channels::Y => png::ColorType::Grayscale,
        Channels::Ya => png::ColorType::GrayscaleAlpha,
        Channels::Rgb => png::ColorType::Rgb,
        Channels::Rgba => png::ColorType::Rgba,
    });
    encoder.set_depth(if picture.sample == Sample::U16 { png::BitDepth::Sixteen } else { png::BitDepth::Eight });
    encoder.set_compression(match compression {
        Compression::Balanced => png::Compression::Balanced,
        Compression::Best => png::Compression::High,
        _ => png::Compression::Fastest,
    });
    if tag_colour {
        tag(&mut encoder, &picture.colour);
    }
    encoder
}

/// Writes the pixels of one frame.
pub(crate) fn put<W: Write>(writer: &mut png::Writer<W>, picture: &Picture) -> Result<(), Fault> {
    if picture.sample == Sample::U16 {
        let mut swapped = picture.bytes.clone();
        swap_to_native(&mut swapped);
        writer.write_image_data(&swapped).map_err(failure)
    } else {
        writer.write_image_data(&picture.bytes).map_err(failure)
    }
}

fn tag<W: Write>(encoder: &mut png::Encoder<'_, W>, colour: &Colour) {
    if *colour == Colour::SRGB {
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        return;
    }
    match colour.transfer {
        Transfer::Linear => encoder.set_source_gamma(png::ScaledFloat::new(1.0)),
        Transfer::Gamma(gamma) => encoder.set_source_gamma(png::ScaledFloat::new(1.0 / gamma)),
        Transfer::Srgb => {}
    }
    let point = |[x, y]: [f64; 2]| (png::ScaledFloat::new(x as f32), png::ScaledFloat::new(y as f32));
    let p = &colour.primaries;
    encoder.set_source_chromaticities(png::SourceChromaticities {
        white: point(p.white),
        red: point(p.red),
        green: point(p.green),
        blue: point(p.blue),
    });
}

/// A file whose rows are being written. Filters and compression are those of [`encode`], but the compressed stream is
/// put together otherwise (and cannot be given up for an uncompressed one in the end, as that of noise is there), so
/// the pixels are the same and the bytes are not.
pub(crate) struct RowEncoder<W: Write + 'static> {
    writer: png::StreamWriter<'static, W>,
    wide: bool,
}

impl<W: Write + 'static> RowEncoder<W> {
    /// Begins a file for a picture like this one, whose bytes are not looked at.
    pub(crate) fn begin(out: W, like: &Picture, compression: Compression, tag_colour: bool) -> Result<Self, Fault> {
        const CHUNK: usize = 1 << 20;
        let writer = encoder(out, like, compression, tag_colour).write_header().map_err(failure)?;
        Ok(Self { writer: writer.into_stream_writer_with_size(CHUNK).map_err(failure)?, wide: like.sample == Sample::U16 })
    }

    /// Appends rows.
    pub(crate) fn write(&mut self, band: &[u8]) -> Result<(), Fault> {
        const PIECE: usize = 1 << 16;
        if !self.wide {
            return self.writer.write_all(band).map_err(Fault::Io);
        }
        let mut swapped = Vec::with_capacity(PIECE);
        for piece in band.chunks(PIECE) {
            swapped.clear();
            swapped.extend_from_slice(piece);
            swap_to_native(&mut swapped);
            self.writer.write_all(&swapped).map_err(Fault::Io)?;
        }
        Ok(())
    }

    pub(crate) fn finish(self) -> Result<(), Fault> {
        self.writer.finish().map_err(failure)
    }
}

/// Big endian ↔ native, both ways.
fn swap_to_native(bytes: &mut [u8]) {
    for word in bytes.as_chunks_mut::<2>().0 {
        *word = u16::from_be_bytes(*word).to_ne_bytes();
    }
}

fn fault(error: png::DecodingError) -> Fault {
    match error {
        png::DecodingError::LimitsExceeded => Fault::TooLarge("it needs more memory than the limit".to_owned()),
        png::DecodingError::IoError(_) => Fault::damaged("it ends too early"),
        other => Fault::damaged(other),
    }
}

pub(crate) fn failure(error: png::EncodingError) -> Fault {
    match error {
        png::EncodingError::IoError(error) => Fault::Io(error),
        other => Fault::Form(other.to_string()),
    }
}
