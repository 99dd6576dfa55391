//! NumPy's array format (NEP 1), versions 1 to 3: images and volumes in, tables both ways.
//!
//! The header is a Python dictionary literal. `numpy` always writes its three keys as
//! `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }`, in any order; nothing more of Python is understood.

use crate::error::Fault;

/// The type of an array's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Element {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F16,
    F32,
    F64,
}

impl Element {
    pub(crate) const fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    const fn code(self) -> &'static str {
        match self {
            Self::U8 => "u1",
            Self::I8 => "i1",
            Self::U16 => "u2",
            Self::I16 => "i2",
            Self::U32 => "u4",
            Self::I32 => "i4",
            Self::F16 => "f2",
            Self::F32 => "f4",
            Self::F64 => "f8",
        }
    }
}

/// An array within a file.
pub(crate) struct Array<'a> {
    pub(crate) element: Element,
    pub(crate) big_endian: bool,
    /// Slowest axis first, or last in Fortran order.
    pub(crate) shape: Vec<usize>,
    /// Whether the first axis is the fastest in memory.
    pub(crate) fortran: bool,
    /// All bytes after the header; may be longer or shorter than the shape asks for.
    pub(crate) rest: &'a [u8],
}

impl<'a> Array<'a> {
    pub(crate) fn parse(bytes: &'a [u8]) -> Result<Self, Fault> {
        let short = || Fault::damaged("it ends within its header");
        let version = *bytes.get(6).ok_or_else(short)?;
        let (length, start) = match version {
            1 => (bytes.get(8..10).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]]))), 10),
            2 | 3 => (bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize), 12),
            other => return Err(Fault::unsupported(format!("version {other}"))),
        };
        let end = start + length.ok_or_else(short)?;
        let text = bytes.get(start..end).ok_or_else(short)?;
        let text = std::str::from_utf8(text).map_err(|_| Fault::damaged("its header is no text"))?;

        let code = value_of(text, "descr")
            .and_then(quoted)
            .ok_or_else(|| Fault::unsupported("an array of records; save one plain array of u1, i1, u2, i2, u4, i4, f2, f4 or f8"))?;
        let all =
            [Element::U8, Element::I8, Element::U16, Element::I16, Element::U32, Element::I32, Element::F16, Element::F32, Element::F64];
        let (order, code_only) = code.split_at_checked(1).unwrap_or(("", ""));
        let element = all
            .into_iter()
            .find(|element| element.code() == code_only && matches!(order, "<" | ">" | "|" | "="))
            .ok_or_else(|| Fault::unsupported(format!("elements of type `{code}`; use u1, i1, u2, i2, u4, i4, f2, f4 or f8")))?;
        let fortran = value_of(text, "fortran_order").ok_or_else(|| Fault::damaged("it has no `fortran_order`"))?.starts_with("True");
        let shape = value_of(text, "shape")
            .and_then(|value| value.strip_prefix('(')?.split_once(')'))
            .ok_or_else(|| Fault::damaged("it has no `shape`"))?
            .0;
        let axes = shape.split(',').map(str::trim).filter(|axis| !axis.is_empty());
        let shape: Result<Vec<usize>, _> = axes.map(str::parse).collect();
        let shape = shape.map_err(|_| Fault::damaged("its `shape` is no list of numbers"))?;
        Ok(Self { element, big_endian: order == ">", shape, fortran, rest: &bytes[end..] })
    }

    /// Number of elements; `None` where that overflows.
    pub(crate) fn count(&self) -> Option<usize> {
        self.shape.iter().try_fold(1_usize, |product, &axis| product.checked_mul(axis))
    }

    /// The elements in native byte order, the last axis fastest.
    pub(crate) fn native(&self) -> Result<Vec<u8>, Fault> {
        if self.fortran && self.shape.len() > 1 {
            return Err(Fault::unsupported("Fortran order; save it with numpy.ascontiguousarray"));
        }
        let size = self.element.bytes();
        let wanted = self.count().and_then(|count| count.checked_mul(size));
        let data = wanted.and_then(|wanted| self.rest.get(..wanted)).ok_or_else(|| Fault::damaged("it is shorter than its shape says"))?;
        let mut data = data.to_vec();
        if self.big_endian != cfg!(target_endian = "big") {
            data.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        }
        Ok(data)
    }
}

fn value_of<'t>(text: &'t str, key: &str) -> Option<&'t str> {
    let quoted = [format!("'{key}'"), format!("\"{key}\"")];
    let at = quoted.iter().find_map(|key| text.find(key.as_str()).map(|at| at + key.len()))?;
    Some(text[at..].trim_start().strip_prefix(':')?.trim_start())
}

fn quoted(value: &str) -> Option<&str> {
    let quote = value.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    value[1..].split_once(quote).map(|(inner, _)| inner)
}

/// A version 1.0 header for little-endian elements; data follows at a multiple of 64 bytes.
pub(crate) fn header(element: Element, shape: &[usize]) -> Vec<u8> {
    let order = if element.bytes() == 1 { '|' } else { '<' };
    let axes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    // Python writes a tuple of one as `(3,)` and of two as `(3, 4)`.
    let axes = axes.join(", ") + if shape.len() == 1 { "," } else { "" };
    let mut text = format!("{{'descr': '{order}{}', 'fortran_order': False, 'shape': ({axes}), }}", element.code());
    let padding = 63 - (10 + text.len()) % 64;
    text.extend(std::iter::repeat_n(' ', padding));
    text.push('\n');
    [b"\x93NUMPY\x01\x00".as_slice(), &(text.len() as u16).to_le_bytes(), text.as_bytes()].concat()
}

/// Native ↔ little endian.
pub(crate) fn to_little_endian(element: Element, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if cfg!(target_endian = "big") {
        bytes.chunks_exact_mut(element.bytes()).for_each(<[u8]>::reverse);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_round_trip() {
        for shape in [vec![], vec![7], vec![3, 4], vec![2, 3, 4]] {
            let bytes = header(Element::F32, &shape);
            assert_eq!(bytes.len() % 64, 0);
            let array = Array::parse(&bytes).unwrap();
            assert_eq!((array.element, array.shape), (Element::F32, shape));
        }
    }

    #[test]
    fn impossible_shapes_are_refused() {
        let mut bytes = header(Element::F64, &[usize::MAX, usize::MAX]);
        bytes.extend([0; 64]);
        assert!(Array::parse(&bytes).unwrap().native().is_err());
    }
}
