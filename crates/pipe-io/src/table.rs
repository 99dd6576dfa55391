//! Tables (histograms, curves, weights): CSV, JSON and NPY, both ways.
//!
//! - CSV has the header `index,value` and one entry a line. Reading takes that, or bare values one a line.
//! - JSON is one array of numbers. JSON has no NaN and no infinity: they are the strings `"NaN"`, `"Infinity"` and
//!   `"-Infinity"`, which JavaScript's `Number()` and Python's `float()` both understand.
//! - NPY is version 1.0, `<f4` or `<u4`, one axis.
//!
//! Floats are written with as many digits as it takes to read the same float back.

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use crate::atomic::AtomicFile;
use crate::error::{Error, Result};
use crate::npy::{self, Array, Element};

/// A one-dimensional array, as a `Table` edge carries it.
#[derive(Clone, Debug, PartialEq)]
pub enum Table {
    /// f32 entries.
    Float(Vec<f32>),
    /// u32 entries.
    Uint(Vec<u32>),
}

impl Table {
    /// Number of entries.
    pub fn len(&self) -> usize {
        match self {
            Self::Float(values) => values.len(),
            Self::Uint(values) => values.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The entries as JSON, in the notation of the file format.
    pub fn to_json(&self) -> serde_json::Value {
        match self {
            Self::Float(values) => values.iter().map(|&value| json_number(value)).collect(),
            Self::Uint(values) => values.iter().copied().collect(),
        }
    }
}

/// A file format for tables and regions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Notation {
    /// Comma-separated values.
    Csv,
    /// JSON.
    Json,
    /// NumPy array.
    Npy,
}

impl Notation {
    /// By the extension of a path.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        match extension.to_ascii_lowercase().as_str() {
            "csv" => Ok(Self::Csv),
            "json" => Ok(Self::Json),
            "npy" => Ok(Self::Npy),
            _ => Err(Error::UnknownExtension { file: path.display().to_string(), known: ".csv .json .npy".to_owned() }),
        }
    }
}

/// Writes a table; the extension of `path` chooses the notation.
pub fn write(path: &Path, table: &Table) -> Result<()> {
    let bytes = match (Notation::of(path)?, table) {
        (Notation::Csv, Table::Float(values)) => csv(values.iter().map(|&value| csv_number(value))),
        (Notation::Csv, Table::Uint(values)) => csv(values.iter()),
        (Notation::Json, table) => format!("{}\n", table.to_json()).into_bytes(),
        (Notation::Npy, Table::Float(values)) => npy_bytes(Element::F32, bytemuck::cast_slice(values), &[values.len()]),
        (Notation::Npy, Table::Uint(values)) => npy_bytes(Element::U32, bytemuck::cast_slice(values), &[values.len()]),
    };
    save(path, &bytes)
}

/// Reads a table; the extension of `path` chooses the notation. Whole numbers that fit make a [`Table::Uint`] when the
/// notation does not say (CSV, JSON): a table whose every entry is written without point or exponent.
pub fn read(path: &Path) -> Result<Table> {
    let notation = Notation::of(path)?;
    let file = || path.display().to_string();
    // A table has no business being larger.
    let limits = crate::Limits { max_bytes: 1 << 30, ..crate::Limits::default() };
    let bytes = crate::source::load(&crate::Source::file(path), &limits)?;
    let damaged = |format, reason: String| Error::Damaged { file: file(), format, reason };
    match notation {
        Notation::Csv => {
            let text = std::str::from_utf8(&bytes).map_err(|_| damaged("CSV", "it is no text".to_owned()))?;
            read_csv(text).map_err(|reason| damaged("CSV", reason))
        }
        Notation::Json => {
            let values: Vec<serde_json::Value> =
                serde_json::from_slice(&bytes).map_err(|error| damaged("JSON", format!("no array: {error}")))?;
            let words = values.iter().map(|value| match value {
                serde_json::Value::String(text) => Ok(text.clone()),
                serde_json::Value::Number(number) => Ok(number.to_string()),
                other => Err(damaged("JSON", format!("`{other}` is no number"))),
            });
            let words: Vec<String> = words.collect::<Result<_>>()?;
            numbers(words.iter().map(String::as_str)).map_err(|reason| damaged("JSON", reason))
        }
        Notation::Npy => {
            let parsed = Array::parse(&bytes).and_then(|array| read_npy(&array));
            parsed.map_err(|fault| fault.of(file(), crate::Format::Npy))
        }
    }
}

fn read_csv(text: &str) -> std::result::Result<Table, String> {
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty()).peekable();
    if lines.peek().is_some_and(|line| !line.split(',').any(|word| word.trim().parse::<f64>().is_ok())) {
        lines.next();
    }
    let mut values = Vec::new();
    for line in lines {
        let mut cells = line.split(',').map(str::trim);
        match (cells.next(), cells.next(), cells.next()) {
            (Some(value), None, None) | (Some(_), Some(value), None) => values.push(value),
            _ => return Err(format!("`{line}` is neither `value` nor `index,value`")),
        }
    }
    numbers(values.into_iter())
}

fn numbers<'a>(words: impl Iterator<Item = &'a str> + Clone) -> std::result::Result<Table, String> {
    if let Some(values) = words.clone().map(|word| word.parse().ok()).collect::<Option<Vec<u32>>>() {
        return Ok(Table::Uint(values));
    }
    let parse = |word: &str| word.parse::<f32>().map_err(|_| format!("`{word}` is no number"));
    words.map(parse).collect::<std::result::Result<_, _>>().map(Table::Float)
}

fn read_npy(array: &Array<'_>) -> std::result::Result<Table, crate::error::Fault> {
    let bytes = array.native()?;
    let words = bytes.as_chunks::<4>().0.iter().copied();
    Ok(match array.element {
        Element::U8 => Table::Uint(bytes.iter().copied().map(u32::from).collect()),
        Element::U16 => Table::Uint(bytes.as_chunks::<2>().0.iter().map(|&two| u16::from_ne_bytes(two).into()).collect()),
        Element::I8 => Table::Float(bytes.iter().map(|&byte| f32::from(byte as i8)).collect()),
        Element::I16 => Table::Float(bytes.as_chunks::<2>().0.iter().map(|&two| i16::from_ne_bytes(two).into()).collect()),
        Element::U32 => Table::Uint(words.map(u32::from_ne_bytes).collect()),
        Element::I32 => Table::Float(words.map(|four| i32::from_ne_bytes(four) as f32).collect()),
        Element::F16 => {
            let halves = bytes.as_chunks::<2>().0.iter();
            Table::Float(halves.map(|&two| half::f16::from_ne_bytes(two).to_f32()).collect())
        }
        Element::F32 => Table::Float(words.map(f32::from_ne_bytes).collect()),
        Element::F64 => {
            let doubles = bytes.as_chunks::<8>().0.iter();
            Table::Float(doubles.map(|&eight| f64::from_ne_bytes(eight) as f32).collect())
        }
    })
}

fn csv(values: impl Iterator<Item = impl std::fmt::Display>) -> Vec<u8> {
    let mut text = String::from("index,value\n");
    for (index, value) in values.enumerate() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{index},{value}");
    }
    text.into_bytes()
}

/// The shortest text that reads back as the same float; NaN and infinities as JSON's strings have them.
pub(crate) fn csv_number(value: f32) -> String {
    match value {
        v if v.is_nan() => "NaN".to_owned(),
        f32::INFINITY => "Infinity".to_owned(),
        f32::NEG_INFINITY => "-Infinity".to_owned(),
        // Always with a point or an exponent, so that a float table reads back as one.
        v => format!("{v:?}"),
    }
}

/// A JSON number, or a string for what JSON cannot say.
pub(crate) fn json_number(value: f32) -> serde_json::Value {
    // Through the shortest decimal of the f32: widening to f64 would print 0.1 as 0.10000000149011612.
    let shortest: Option<f64> = csv_number(value).parse().ok().filter(|v: &f64| v.is_finite());
    match shortest.and_then(serde_json::Number::from_f64) {
        Some(number) => serde_json::Value::Number(number),
        None => serde_json::Value::String(csv_number(value)),
    }
}

pub(crate) fn npy_bytes(element: Element, bytes: &[u8], shape: &[usize]) -> Vec<u8> {
    [npy::header(element, shape), npy::to_little_endian(element, bytes)].concat()
}

pub(crate) fn save(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = |error: io::Error| Error::write(path.display(), error);
    AtomicFile::write_whole(Some(path), bytes).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let floats = Table::Float(vec![0.1, -0.0, 1.0, f32::MAX, f32::MIN_POSITIVE, f32::INFINITY, 1e-45, 3.0]);
        let uints = Table::Uint(vec![0, 1, u32::MAX]);
        for name in ["t.csv", "t.json", "t.npy"] {
            let path = folder.path().join(name);
            for table in [&floats, &uints] {
                write(&path, table).unwrap();
                assert_eq!(&read(&path).unwrap(), table, "{name}");
            }
        }
    }

    #[test]
    fn json_is_valid_and_short() {
        let table = Table::Float(vec![0.1, f32::NAN, f32::NEG_INFINITY, 2.0]);
        assert_eq!(table.to_json().to_string(), r#"[0.1,"NaN","-Infinity",2.0]"#);
    }

    #[test]
    fn mistakes_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        std::fs::write(&path, "index,value\n0,one\n").unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("`one` is no number"));
        assert!(write(&folder.path().join("t.txt"), &Table::Uint(vec![])).is_err());
    }
}
