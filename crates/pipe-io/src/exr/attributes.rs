//! What an EXR header says beside its pixels: kept on the way in, written again on the way out.

use std::fmt;

use exr::meta::attribute::AttributeValue;
use exr::meta::header::{Header as Part, ImageAttributes, LayerAttributes, standard_names};

/// The attributes of one part: owner, comments, camera, time code, and whatever a program added.
///
/// Opaque, because its meaning is between the program that wrote it and the one that will read it; what describes the
/// layout of the pixels (windows, channels, compression, chromaticities, views, the preview) is left out, since the
/// writer sets it anew.
#[derive(Clone, PartialEq)]
pub struct Attributes {
    image: ImageAttributes,
    layer: Box<LayerAttributes>,
}

impl Attributes {
    pub(super) fn of(part: &Part) -> Self {
        let mut image = part.shared_attributes.clone();
        let mut layer = part.own_attributes.clone();
        image.chromaticities = None;
        layer.layer_name = None;
        layer.layer_position = exr::math::Vec2(0, 0);
        layer.preview = None;
        layer.multi_view_names = None;
        layer.view_name = None;
        layer.deep_image_state = None;
        layer.original_data_window = None;
        for other in [&mut image.other, &mut layer.other] {
            other.retain(|name, _| !standard_names::ALL.contains(&name.as_slice()) && name.as_slice() != b"dwaCompressionLevel");
        }
        Self { image, layer: Box::new(layer) }
    }

    /// Puts the attributes into a new part, whose windows and chromaticities stay its own.
    pub(super) fn apply(&self, part: Part) -> Part {
        let image = ImageAttributes {
            display_window: part.shared_attributes.display_window,
            chromaticities: part.shared_attributes.chromaticities,
            ..self.image.clone()
        };
        part.with_attributes((*self.layer).clone()).with_shared_attributes(image)
    }

    /// Name and value of every attribute, as text, sorted by name.
    pub fn list(&self) -> Vec<(String, String)> {
        let bare = self.apply(Part::new(exr::prelude::Text::default(), (1, 1), std::iter::empty().collect()));
        let mut list: Vec<_> = bare
            .all_named_attributes()
            .filter(|(name, _)| !LAYOUT.contains(name))
            .map(|(name, value)| (String::from_utf8_lossy(name).into_owned(), text(&value)))
            .collect();
        list.sort();
        list
    }
}

const LAYOUT: [&[u8]; 9] = [
    standard_names::TILES,
    standard_names::BLOCK_TYPE,
    standard_names::CHUNKS,
    standard_names::CHANNELS,
    standard_names::COMPRESSION,
    standard_names::DATA_WINDOW,
    standard_names::DISPLAY_WINDOW,
    standard_names::LINE_ORDER,
    standard_names::NAME,
];

fn text(value: &AttributeValue) -> String {
    match value {
        AttributeValue::Text(text) => text.to_string(),
        AttributeValue::F32(value) => value.to_string(),
        AttributeValue::F64(value) => value.to_string(),
        AttributeValue::I32(value) => value.to_string(),
        AttributeValue::Bytes { bytes, .. } | AttributeValue::Custom { bytes, .. } => {
            format!("{} bytes", bytes.len())
        }
        other => format!("{other:?}"),
    }
}

impl fmt::Debug for Attributes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.list()).finish()
    }
}
