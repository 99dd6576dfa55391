//! Parameters that are one number for every component, or a number for each: colours, and the sizes of sources and lights.
//!
//! They are read by a visitor of their own and not by an untagged enum, so that each number may be an expression and
//! each mistake keeps its place.

use std::fmt;
use std::marker::PhantomData;

use pipe_graph::prelude::*;
use schemars::{Schema, SchemaGenerator, json_schema};
use serde::Deserializer;
use serde::de::value::{F64Deserializer, I64Deserializer};
use serde::de::{Error, IntoDeserializer, SeqAccess, Visitor};
use serde::ser::Serializer;

/// Red, green and blue: `v` for all, or `(r, g, b)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rgb(pub(crate) [f32; 3]);

/// Red, green, blue and alpha: `v` for an opaque grey, `(r, g, b)` for an opaque colour, or `(r, g, b, a)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rgba(pub(crate) [f32; 4]);

/// Width and height: `n` for a square, or `(width, height)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Size(pub(crate) [u32; 2]);

/// Lengths of the sides of a rectangle: `a` for a square, or `(a, b)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sides(pub(crate) [f32; 2]);

impl Rgb {
    /// The same number for every channel.
    pub(crate) const fn grey(v: f32) -> Self {
        Self([v; 3])
    }

    /// Whether channels are treated alike.
    pub(crate) fn is_grey(&self) -> bool {
        let [r, g, b] = self.0;
        r == g && g == b
    }

    /// Component `i`, for twins.
    pub(crate) fn at(&self, i: usize) -> f64 {
        f64::from(self.0[i])
    }
}

/// What was written.
enum Written<T> {
    One(T),
    Each(Vec<T>),
}

struct Reader<T> {
    expected: &'static str,
    of: PhantomData<T>,
}

impl<'de, T: Deserialize<'de>> Reader<T> {
    fn whole<E: Error>(v: i64) -> Result<Written<T>, E> {
        let number: I64Deserializer<E> = v.into_deserializer();
        T::deserialize(number).map(Written::One)
    }
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for Reader<T> {
    type Value = Written<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected)
    }
    fn visit_i64<E: Error>(self, v: i64) -> Result<Self::Value, E> {
        Self::whole(v)
    }
    fn visit_u64<E: Error>(self, v: u64) -> Result<Self::Value, E> {
        Self::whole(i64::try_from(v).map_err(E::custom)?)
    }
    fn visit_f64<E: Error>(self, v: f64) -> Result<Self::Value, E> {
        // Expressions have no type: 256.0 is as good a size as 256.
        if v.fract() == 0.0 && v.abs() < 9e15 {
            return Self::whole(v as i64);
        }
        let number: F64Deserializer<E> = v.into_deserializer();
        T::deserialize(number).map(Written::One)
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut each = Vec::new();
        while let Some(v) = list.next_element()? {
            each.push(v);
        }
        Ok(Written::Each(each))
    }
}

fn read<'de, D: Deserializer<'de>, T: Deserialize<'de>>(d: D, expected: &'static str) -> Result<Written<T>, D::Error> {
    d.deserialize_any(Reader { expected, of: PhantomData })
}

fn wrong_length<E: Error>(n: usize, expected: &str) -> E {
    E::custom(format!("found {n} numbers, expected {expected}"))
}

impl<'de> Deserialize<'de> for Rgb {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let expected = "a number or (r, g, b)";
        match read(d, expected)? {
            Written::One(v) => Ok(Self::grey(v)),
            Written::Each(v) => v.as_slice().try_into().map(Self).map_err(|_| wrong_length(v.len(), expected)),
        }
    }
}

impl<'de> Deserialize<'de> for Rgba {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let expected = "a number, (r, g, b) or (r, g, b, a)";
        match read(d, expected)? {
            Written::One(v) => Ok(Self([v, v, v, 1.0])),
            Written::Each(v) => match v[..] {
                [r, g, b] => Ok(Self([r, g, b, 1.0])),
                [r, g, b, a] => Ok(Self([r, g, b, a])),
                _ => Err(wrong_length(v.len(), expected)),
            },
        }
    }
}

impl<'de> Deserialize<'de> for Size {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let expected = "a number of pixels or (width, height)";
        match read(d, expected)? {
            Written::One(n) => Ok(Self([n; 2])),
            Written::Each(v) => v.as_slice().try_into().map(Self).map_err(|_| wrong_length(v.len(), expected)),
        }
    }
}

impl<'de> Deserialize<'de> for Sides {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let expected = "a number or two";
        match read(d, expected)? {
            Written::One(a) => Ok(Self([a; 2])),
            Written::Each(v) => v.as_slice().try_into().map(Self).map_err(|_| wrong_length(v.len(), expected)),
        }
    }
}

impl Serialize for Rgb {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        if self.is_grey() { self.0[0].serialize(s) } else { self.0.serialize(s) }
    }
}

impl Serialize for Rgba {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(s)
    }
}

impl Serialize for Size {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(s)
    }
}

impl Serialize for Sides {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(s)
    }
}

/// A number, or a list of as many numbers as one of these lengths.
fn schema(ty: &str, lengths: &[usize]) -> Schema {
    let number = json_schema!({ "type": ty });
    let lists = lengths.iter().map(|n| {
        let items = vec![number.clone(); *n];
        json_schema!({ "type": "array", "prefixItems": items, "minItems": n, "maxItems": n })
    });
    let forms: Vec<Schema> = std::iter::once(number.clone()).chain(lists).collect();
    json_schema!({ "anyOf": forms })
}

macro_rules! schemas {
    ($($name:ident $ty:literal $lengths:expr;)*) => {$(
        impl JsonSchema for $name {
            fn inline_schema() -> bool {
                true
            }
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }
            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                schema($ty, &$lengths)
            }
        }
    )*};
}

schemas! {
    Rgb "number" [3];
    Rgba "number" [3, 4];
    Size "integer" [2];
    Sides "number" [2];
}
