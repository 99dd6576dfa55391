//! Images, volumes, tables and meshes between files and host memory.
//!
//! No GPU, no terminal, no environment. The crate decodes to the file's own sample type and says what the numbers mean
//! ([`Picture`], [`Colour`]); the GPU's first kernel converts. The other way round [`output_form`] says in which form
//! a file wants its pixels, the GPU's last kernel packs them so, and [`write`] compresses.
//!
//! ```no_run
//! use pipe_io::{Input, ReadOptions, Source, Target, WriteOptions, output_form, write};
//!
//! let input = Input::open(&Source::parse("in.exr#diffuse"), &ReadOptions::default())?;
//! println!("{} × {}", input.header()?.width, input.header()?.height); // planning needs no pixels
//! let picture = input.read()?;
//! let target = Target::parse("out.png")?;
//! let form = output_form(&target, &WriteOptions::default(), Some(&picture.metadata))?;
//! let packed: Vec<u8> = todo!("the GPU stores the pixels in that form");
//! write(&target, &form.picture(picture.width, picture.height, packed, picture.metadata), &WriteOptions::default())?;
//! # Ok::<(), pipe_io::Error>(())
//! ```
//!
//! Pictures that are larger than memory are read and written by bands of rows: [`RowReader`], [`RowWriter`].
//!
//! Files are hostile until proven otherwise: declared sizes are checked against [`Limits`] and the file's length
//! before anything of that size is allocated, and every failure is an [`Error`] that names the file.

#![forbid(unsafe_code)]

mod animation;
pub mod atomic;
pub mod colour;
mod error;
mod exr;
mod form;
mod guard;
mod icc;
mod input;
mod jpeg;
pub mod mesh;
mod npy;
mod output;
mod picture;
mod plain;
mod png;
mod raster;
pub mod region;
mod rows;
pub mod sequence;
mod source;
mod store;
pub mod table;
mod tiff;
pub mod volume;

pub use self::animation::Animation;
pub use self::colour::{Colorspace, Colour, Primaries, Transfer};
pub use self::error::{Error, Result};
pub use self::exr::Attributes;
pub use self::form::{Compression, Form, WriteOptions, output_form};
pub use self::input::{Input, ReadOptions, probe, read};
pub use self::output::{encode, write};
pub use self::picture::{Alpha, Channels, Header, Layout, Metadata, Picture, Sample, Window};
pub use self::rows::{ReadAhead, RowReader, RowWriter, WriteBehind};
pub use self::source::{Format, Limits, Source, Target};
