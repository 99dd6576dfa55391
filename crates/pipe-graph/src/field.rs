//! The types that the fields of a node are made of, beside plain numbers, strings, lists and enums.
//!
//! A node's struct is its schema, its parser and its manual at once. Fields of these types tell the
//! deserialiser ([`crate::de`]) that a string is the name of an edge, by asking for a newtype whose name starts
//! with `$pipe::`; the deserialiser notes the edge and hands back its index among the node's edges.

use std::fmt;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer, Error, Visitor};
use serde::ser::{Serialize, Serializer};

use crate::types::EdgeKind;

/// Which edges a field accepts.
pub trait Accepts: 'static {
    /// `$pipe::edge:` and the accepted kinds, separated by `|`.
    const TOKEN: &'static str;
    /// The same for a field that takes a value in place of an edge.
    const TOKEN_OR_VALUE: &'static str;

    /// The kinds in [`Accepts::TOKEN`].
    fn kinds() -> Vec<EdgeKind> {
        kinds_of_token(Self::TOKEN)
    }
}

/// The kinds that a token names.
pub fn kinds_of_token(token: &str) -> Vec<EdgeKind> {
    let all = [EdgeKind::Image, EdgeKind::Volume, EdgeKind::Table, EdgeKind::Scalar, EdgeKind::Mesh];
    let names = token.rsplit(':').next().unwrap_or_default();
    names.split('|').filter_map(|n| all.into_iter().find(|k| k.name() == n)).collect()
}

macro_rules! accepts {
    ($($(#[$doc:meta])* $name:ident = $kinds:literal;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $name {}
        impl Accepts for $name {
            const TOKEN: &'static str = concat!("$pipe::edge:", $kinds);
            const TOKEN_OR_VALUE: &'static str = concat!("$pipe::edge_or_value:", $kinds);
        }
    )*};
}

accepts! {
    /// An image edge.
    Image = "Image";
    /// A volume edge.
    Volume = "Volume";
    /// A table edge.
    Table = "Table";
    /// A scalar edge.
    Scalar = "Scalar";
    /// A mesh edge.
    Mesh = "Mesh";
    /// An image or a volume.
    ImageOrVolume = "Image|Volume";
    /// An image or a table.
    ImageOrTable = "Image|Table";
    /// An image, a volume or a table.
    Array = "Image|Volume|Table";
    /// Any edge at all.
    Any = "Image|Volume|Table|Scalar|Mesh";
}

/// Index of an edge among the edges of one node, in the order in which its fields were read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct EdgeIndex(pub u32);

impl EdgeIndex {
    /// A field that nothing was given for.
    pub const UNBOUND: Self = Self(u32::MAX);
}

/// An input port. In a graph file: the name of a node, `"node.port"`, or a graph input.
pub struct In<T> {
    /// Which of the node's edges.
    pub edge: EdgeIndex,
    kind: PhantomData<T>,
}

impl<T> In<T> {
    /// The port that reads this edge.
    pub const fn new(edge: EdgeIndex) -> Self {
        Self { edge, kind: PhantomData }
    }

    /// Whether the file named an edge.
    pub const fn is_bound(&self) -> bool {
        self.edge.0 != EdgeIndex::UNBOUND.0
    }
}

impl<T> Clone for In<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for In<T> {}
impl<T> Default for In<T> {
    fn default() -> Self {
        Self::new(EdgeIndex::UNBOUND)
    }
}
impl<T> PartialEq for In<T> {
    fn eq(&self, other: &Self) -> bool {
        self.edge == other.edge
    }
}
impl<T: Accepts> fmt::Debug for In<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}#{}", T::TOKEN, self.edge.0)
    }
}

/// What the deserialiser answers for a `$pipe::` newtype: an edge as `u64`, a number as `f64`.
struct Answer(&'static str);

enum Answered {
    Edge(EdgeIndex),
    Number(f64),
}

impl Visitor<'_> for Answer {
    type Value = Answered;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
    fn visit_u64<E: Error>(self, v: u64) -> Result<Answered, E> {
        u32::try_from(v).map(|i| Answered::Edge(EdgeIndex(i))).map_err(E::custom)
    }
    fn visit_f64<E: Error>(self, v: f64) -> Result<Answered, E> {
        Ok(Answered::Number(v))
    }
}

impl<'de, T: Accepts> Deserialize<'de> for In<T> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        match d.deserialize_newtype_struct(T::TOKEN, Answer("the name of a node or of a graph input"))? {
            Answered::Edge(edge) => Ok(Self::new(edge)),
            Answered::Number(_) => Err(D::Error::custom("expected an edge")),
        }
    }
}

impl<T> Serialize for In<T> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.serialize_none()
    }
}

impl<T: Accepts> JsonSchema for In<T> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        T::TOKEN.into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let names: Vec<_> = T::kinds().into_iter().map(EdgeKind::name).collect();
        json_schema!({ "type": "string", "x-edge": names.join(" or ") })
    }
}

/// A number, or the first component of a `Scalar` edge (`~` in the reference): its value never visits the CPU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Driven {
    /// Known when planning.
    Value(f32),
    /// Read on the GPU.
    Scalar(In<Scalar>),
}

impl Driven {
    pub(crate) const TOKEN: &'static str = "$pipe::driven:Scalar";

    /// The value, when it is known before the run.
    pub const fn value(&self) -> Option<f32> {
        match self {
            Self::Value(v) => Some(*v),
            Self::Scalar(_) => None,
        }
    }
}

impl Default for Driven {
    fn default() -> Self {
        Self::Value(0.0)
    }
}

impl From<f32> for Driven {
    fn from(v: f32) -> Self {
        Self::Value(v)
    }
}

impl<'de> Deserialize<'de> for Driven {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        Ok(match d.deserialize_newtype_struct(Self::TOKEN, Answer("a number or the name of a Scalar"))? {
            Answered::Edge(edge) => Self::Scalar(In::new(edge)),
            Answered::Number(v) => Self::Value(v as f32),
        })
    }
}

impl Serialize for Driven {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Value(v) => s.serialize_f32(*v),
            Self::Scalar(_) => s.serialize_none(),
        }
    }
}

impl JsonSchema for Driven {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Driven".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "number", "x-driven": true })
    }
}

/// An image or a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Operand {
    /// The same value everywhere.
    Number(f32),
    /// Pixel by pixel.
    Image(In<Image>),
}

impl Operand {
    pub(crate) const TOKEN: &'static str = "$pipe::operand:Image";
}

impl Default for Operand {
    fn default() -> Self {
        Self::Number(0.0)
    }
}

impl<'de> Deserialize<'de> for Operand {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        Ok(match d.deserialize_newtype_struct(Self::TOKEN, Answer("a number or the name of an image"))? {
            Answered::Edge(edge) => Self::Image(In::new(edge)),
            Answered::Number(v) => Self::Number(v as f32),
        })
    }
}

impl Serialize for Operand {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Number(v) => s.serialize_f32(*v),
            Self::Image(_) => s.serialize_none(),
        }
    }
}

impl JsonSchema for Operand {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Operand".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["number", "string"], "x-edge": "Image or number" })
    }
}

/// An edge, or a value written in its place: `medium: "fog"` or `medium: Homogeneous(10)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EdgeOr<E: Accepts, V> {
    /// What arrives from another node.
    Edge(In<E>),
    /// What the graph says itself.
    Value(V),
}

impl<'de, E: Accepts, V: Deserialize<'de>> Deserialize<'de> for EdgeOr<E, V> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Either<E, V>(PhantomData<(E, V)>);
        impl<'de, E: Accepts, V: Deserialize<'de>> Visitor<'de> for Either<E, V> {
            type Value = EdgeOr<E, V>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a node or of a graph input, or a value")
            }
            fn visit_u64<R: Error>(self, v: u64) -> Result<Self::Value, R> {
                u32::try_from(v).map(|i| EdgeOr::Edge(In::new(EdgeIndex(i)))).map_err(R::custom)
            }
            fn visit_newtype_struct<D: Deserializer<'de>>(self, d: D) -> Result<Self::Value, D::Error> {
                V::deserialize(d).map(EdgeOr::Value)
            }
        }
        d.deserialize_newtype_struct(E::TOKEN_OR_VALUE, Either(PhantomData))
    }
}

impl<E: Accepts, V: Serialize> Serialize for EdgeOr<E, V> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Edge(_) => s.serialize_none(),
            Self::Value(v) => v.serialize(s),
        }
    }
}

impl<E: Accepts, V: JsonSchema> JsonSchema for EdgeOr<E, V> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        format!("{} or {}", E::TOKEN, V::schema_name()).into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [In::<E>::json_schema(generator), generator.subschema_for::<V>()] })
    }
}
