//! Regions of an image as rows of pixels, for people and notebooks: JSON, CSV, NPY.
//!
//! - JSON: an array of rows, each an array of pixels; a pixel is a number, or an array of numbers where it has several
//!   channels.
//! - CSV: the header `x,y,` and the channels' names, one pixel a line.
//! - NPY: shape h×w, or h×w×c.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

use crate::error::{Error, Result};
use crate::npy::Element;
use crate::table::{Notation, csv_number, json_number, npy_bytes, save};

/// The samples of a region: interleaved, rows top to bottom.
#[derive(Clone, Copy, Debug)]
pub enum Samples<'a> {
    /// Unsigned 8-bit.
    U8(&'a [u8]),
    /// Unsigned 16-bit.
    U16(&'a [u16]),
    /// Signed 32-bit.
    I32(&'a [i32]),
    /// Unsigned 32-bit.
    U32(&'a [u32]),
    /// Halves, as their bits.
    F16(&'a [half::f16]),
    /// Floats.
    F32(&'a [f32]),
}

impl Samples<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::U8(values) => values.len(),
            Self::U16(values) => values.len(),
            Self::I32(values) => values.len(),
            Self::U32(values) => values.len(),
            Self::F16(values) => values.len(),
            Self::F32(values) => values.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn json(&self, index: usize) -> Value {
        match self {
            Self::U8(values) => values[index].into(),
            Self::U16(values) => values[index].into(),
            Self::I32(values) => values[index].into(),
            Self::U32(values) => values[index].into(),
            Self::F16(values) => json_number(values[index].to_f32()),
            Self::F32(values) => json_number(values[index]),
        }
    }

    fn text(&self, index: usize) -> String {
        match self {
            Self::U8(values) => values[index].to_string(),
            Self::U16(values) => values[index].to_string(),
            Self::I32(values) => values[index].to_string(),
            Self::U32(values) => values[index].to_string(),
            Self::F16(values) => csv_number(values[index].to_f32()),
            Self::F32(values) => csv_number(values[index]),
        }
    }

    fn npy(&self, shape: &[usize]) -> Vec<u8> {
        match self {
            Self::U8(values) => npy_bytes(Element::U8, values, shape),
            Self::U16(values) => npy_bytes(Element::U16, bytemuck::cast_slice(values), shape),
            Self::I32(values) => npy_bytes(Element::I32, bytemuck::cast_slice(values), shape),
            Self::U32(values) => npy_bytes(Element::U32, bytemuck::cast_slice(values), shape),
            Self::F16(values) => npy_bytes(Element::F16, bytemuck::cast_slice(values), shape),
            Self::F32(values) => npy_bytes(Element::F32, bytemuck::cast_slice(values), shape),
        }
    }
}

/// A region as JSON, in the notation of the file format; `None` where the samples do not fill it.
pub fn to_json(width: usize, height: usize, channels: usize, samples: Samples<'_>) -> Option<Value> {
    fills(width, height, channels, samples).then(|| {
        let pixel = |index: usize| match channels {
            1 => samples.json(index),
            _ => (0..channels).map(|channel| samples.json(index * channels + channel)).collect(),
        };
        (0..height).map(|y| (0..width).map(|x| pixel(y * width + x)).collect::<Value>()).collect()
    })
}

/// Writes a region of `width`×`height` pixels with a sample for each of the named channels; the extension of `path` chooses the
/// notation.
pub fn write(path: &Path, width: usize, height: usize, names: &[&str], samples: Samples<'_>) -> Result<()> {
    let channels = names.len();
    let notation = Notation::of(path)?;
    if !fills(width, height, channels, samples) {
        let reason = format!("{} samples do not fill {width}×{height} pixels of {channels} channels", samples.len());
        return Err(Error::Form { file: path.display().to_string(), reason });
    }
    let bytes = match notation {
        Notation::Json => {
            let rows = to_json(width, height, channels, samples).unwrap_or_default();
            format!("{rows}\n").into_bytes()
        }
        Notation::Csv => csv(width, height, names, samples).into_bytes(),
        Notation::Npy if channels == 1 => samples.npy(&[height, width]),
        Notation::Npy => samples.npy(&[height, width, channels]),
    };
    save(path, &bytes)
}

/// Writes samples as a NumPy array of one axis, whatever the extension of `path`.
pub fn write_array(path: &Path, samples: Samples<'_>) -> Result<()> {
    save(path, &samples.npy(&[samples.len()]))
}

fn fills(width: usize, height: usize, channels: usize, samples: Samples<'_>) -> bool {
    let wanted = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(channels));
    channels > 0 && wanted == Some(samples.len())
}

fn csv(width: usize, height: usize, names: &[&str], samples: Samples<'_>) -> String {
    let channels = names.len();
    let mut text = format!("x,y,{}\n", names.join(","));
    for y in 0..height {
        for x in 0..width {
            // Writing to a string cannot fail.
            let _ = write!(text, "{x},{y}");
            for channel in 0..channels {
                let _ = write!(text, ",{}", samples.text((y * width + x) * channels + channel));
            }
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(name: &str, channels: &[&str], samples: Samples<'_>) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        write(&path, 2, 2, channels, samples).unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn regions_are_rows_of_pixels() {
        let grey = Samples::F32(&[0.5, f32::NAN, 1.0, -2.0]);
        assert_eq!(written("r.json", &["value"], grey), b"[[0.5,\"NaN\"],[1.0,-2.0]]\n");
        let pairs = Samples::U8(&[1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(written("r.json", &["r", "g"], pairs), b"[[[1,2],[3,4]],[[5,6],[7,8]]]\n");
        assert_eq!(written("r.csv", &["value"], grey), b"x,y,value\n0,0,0.5\n1,0,NaN\n0,1,1.0\n1,1,-2.0\n");
        let npy = written("r.npy", &["r", "g"], pairs);
        assert!(npy.ends_with(&[1, 2, 3, 4, 5, 6, 7, 8]));
        assert!(String::from_utf8_lossy(&npy).contains("'shape': (2, 2, 2)"));
    }

    #[test]
    fn csv_names_the_channels() {
        let pairs = Samples::U8(&[1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(written("r.csv", &["b", "a"], pairs), b"x,y,b,a\n0,0,1,2\n1,0,3,4\n0,1,5,6\n1,1,7,8\n");
    }

    #[test]
    fn arrays_have_one_axis() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        write_array(&path, Samples::U16(&[1, 2, 3])).unwrap();
        let npy = std::fs::read(path).unwrap();
        assert!(
            npy.ends_with(&[1, 0, 2, 0, 3, 0])
                && String::from_utf8_lossy(&npy).contains("'descr': '<u2', 'fortran_order': False, 'shape': (3,)")
        );
    }

    #[test]
    fn wrong_counts_are_refused() {
        assert!(write(Path::new("r.csv"), 2, 2, &["r", "g", "b"], Samples::U8(&[0; 4])).is_err());
        assert!(write(Path::new("r.csv"), usize::MAX, 2, &["r", "g", "b"], Samples::U8(&[0; 4])).is_err());
    }
}
