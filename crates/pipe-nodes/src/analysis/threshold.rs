//! `Threshold`: black or white.

use std::fmt;

use pipe_graph::field::EdgeIndex;
use pipe_graph::prelude::*;
use schemars::{Schema, SchemaGenerator, json_schema};
use serde::de::{Deserializer, Error, Visitor};
use serde::ser::Serializer;
use smart_default::SmartDefault;

use super::bins::{self, Binning, Channel, Outside};
use super::reduction::{self, View, finite_values, view};
use crate::shader;

/// 1 where a value is larger than the threshold, else 0, for every colour channel. Alpha is kept.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Threshold {
    /// The image to divide.
    image: In<Image>,
    /// The threshold: a number, a Scalar, or `Otsu`. Otsu's is the luminance that divides the pixels into the two
    /// classes with the most variance between them (Otsu 1979), from a histogram of 256 bins between the smallest
    /// and the largest luminance: the centre of the last bin of the darker class, as `skimage.filters.threshold_otsu`.
    #[default(Level::Value(Driven::Value(0.5)))]
    value: Level,
}

/// A number, a scalar, or `Otsu`.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Level {
    Value(Driven),
    Otsu,
}

pub(crate) const KIND: Kind = Kind::of::<Threshold>(
    "Threshold",
    Category::Colour,
    &[
        r#"Threshold(image: "in", value: 0.18)"#,
        r#"Threshold(image: "in", value: "scalar")"#,
        r#"Threshold(image: "grey", value: Otsu)"#,
        r#"Threshold(image: "in", value: Otsu)"#,
        r#"Threshold(image: "pair")"#,
    ],
);

/// Bins of the histogram behind Otsu's threshold.
const BINS: u32 = 256;

impl Node for Threshold {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let value = match &self.value {
            Level::Value(value) => cx.driven(value),
            Level::Otsu => Value::Driven(otsu(cx, image)),
        };
        cx.pass("", shader!("analysis/threshold"))
            .entry(Entry::Point)
            .read("image", image, Reach::Point)
            .write("out", out)
            .param("value", value)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let value = match &self.value {
            Level::Value(value) => cx.driven(value),
            Level::Otsu => {
                let y = finite_values(&view(image, View::Luminance), 0);
                otsu_reference(&y.iter().map(|v| f64::from(*v as f32)).collect::<Vec<_>>())
            }
        };
        let side = |v: f64| if v.is_nan() { v } else { f64::from(u8::from(v > value)) };
        vec![Tensor::Image(image.map(image.channels, |[r, g, b, a]| [side(r), side(g), side(b), a]))]
    }
}

/// Otsu's threshold of the luminance of an image: a scalar.
fn otsu(cx: &mut Lowering<'_>, image: ResourceId) -> ResourceId {
    // Rounded as an image holds it, so that what is binned is what the extent was measured of.
    let luminance = cx.intermediate("luminance", Shape::image(cx.image_of(image).size, 1));
    cx.pass("luminance", shader!("analysis/luminance_finite"))
        .entry(Entry::Point)
        .read("image", image, Reach::Point)
        .write("out", luminance)
        .add();
    let extent = reduction::extent(cx, "extent", luminance, View::Channels);
    let binning = Binning {
        bins: BINS,
        low: Value::Driven(extent.min),
        high: Value::Driven(extent.max),
        channel: Channel::R,
        outside: Outside::Ignore,
    };
    let counts = bins::count(cx, "histogram", luminance, &binning);
    let out = cx.intermediate("otsu", Shape::Scalar);
    cx.pass("otsu", shader!("analysis/otsu"))
        .entry(Entry::Kernel)
        .read("counts", counts, Reach::Whole)
        .write("out", out)
        .param("low", Value::Driven(extent.min))
        .param("high", Value::Driven(extent.max))
        .grid(Grid::Groups([1, 1, 1]))
        .add();
    out
}

/// The twin: of the variances between the classes, bin by bin, the first of the largest ones decides.
fn otsu_reference(values: &[f64]) -> f64 {
    let low = values.iter().copied().reduce(f64::min).unwrap_or(0.0);
    let high = values.iter().copied().reduce(f64::max).unwrap_or(0.0);
    if low == high {
        return low;
    }
    let bins = BINS as usize;
    let mut counts = vec![0_u64; bins];
    for v in values {
        counts[(((v - low) / (high - low) * f64::from(BINS)) as usize).min(bins - 1)] += 1;
    }
    let centre = |bin: usize| low + (bin as f64 + 0.5) / f64::from(BINS) * (high - low);
    let class = |range: std::ops::Range<usize>| {
        let n: u64 = range.clone().map(|b| counts[b]).sum();
        let sum: u64 = range.map(|b| counts[b] * b as u64).sum();
        (n as f64, sum as f64)
    };
    let mut best = (0, -1.0);
    for last in 0..bins - 1 {
        let ((n1, s1), (n2, s2)) = (class(0..last + 1), class(last + 1..bins));
        let variance = n1 * n2 * (s1 / n1 - s2 / n2).powi(2);
        if variance > best.1 {
            best = (last, variance);
        }
    }
    centre(best.0)
}

impl Port for Level {
    fn edge(&self) -> Option<EdgeIndex> {
        match self {
            Self::Value(value) => value.edge(),
            Self::Otsu => None,
        }
    }
}

impl<'de> Deserialize<'de> for Level {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        /// As [`Driven`]'s, which a bare name also reaches.
        struct Read;
        impl Visitor<'_> for Read {
            type Value = Level;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, the name of a Scalar, or `Otsu`")
            }
            fn visit_u64<E: Error>(self, edge: u64) -> Result<Level, E> {
                let edge = u32::try_from(edge).map_err(E::custom)?;
                Ok(Level::Value(Driven::Scalar(In::new(EdgeIndex(edge)))))
            }
            fn visit_f64<E: Error>(self, value: f64) -> Result<Level, E> {
                Ok(Level::Value(Driven::Value(value as f32)))
            }
            fn visit_str<E: Error>(self, name: &str) -> Result<Level, E> {
                match name {
                    "Otsu" => Ok(Level::Otsu),
                    other => Err(E::unknown_variant(other, &["Otsu"])),
                }
            }
        }
        d.deserialize_newtype_struct("$pipe::driven:Scalar", Read)
    }
}

impl Serialize for Level {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Value(value) => value.serialize(s),
            Self::Otsu => s.serialize_unit_variant("Level", 1, "Otsu"),
        }
    }
}

impl JsonSchema for Level {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Level".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "number", "x-driven": true })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn otsu_divides_two_clusters_as_scikit_image_does() {
        // skimage.filters.threshold_otsu of the same values, nbins = 256 (scikit-image 0.26).
        let values: Vec<f64> = (0..400).map(|i| f64::from((i * i * 7 + 13) % 101) / 101.0 + if i % 3 == 0 { 1.5 } else { 0.0 }).collect();
        assert!((otsu_reference(&values) - 0.9796855662128713).abs() < 1e-12);
        assert_eq!(otsu_reference(&[0.25; 7]), 0.25);
    }
}
