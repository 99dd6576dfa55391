//! Layers: which channels of which part a name means, and which are read when none is named.
//!
//! EXR has three ways to hold several pictures in a file, and files mix them: parts with names (`rgba.left`), channel
//! names with prefixes (`diffuse.R`), and views (`right` = the unprefixed channels of a `multiView` file). All become
//! one flat list of [`Layer`]s, each with a label to choose it by. A name that is no layer may still be a channel
//! (`Z`, `diffuse.R`), which is then read as grey.

use exr::meta::header::Header as Part;

use crate::error::Fault;

/// What the channels of a layer are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meaning {
    /// Red, green, blue and perhaps alpha; or luminance and perhaps alpha.
    Colour,
    /// Numbers that are not light: depth, normals, motion, one channel of a colour.
    Values,
    /// Y, RY, BY and perhaps A, the chroma subsampled.
    LuminanceChroma,
}

/// One picture within a file.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    /// Index of the part.
    pub(super) part: usize,
    /// What to write after the `#`; empty for the unnamed layer of a file with one part.
    pub(super) label: String,
    /// Other names for it.
    aliases: Vec<String>,
    /// Whether its channels have no prefix.
    unprefixed: bool,
    pub(super) meaning: Meaning,
    /// Indices into the part's channels, in the order of the picture's; `None` reads as zeros.
    pub(super) channels: Vec<Option<usize>>,
    /// Why it cannot be read as a picture, where it cannot.
    obstacle: Option<String>,
}

/// Every layer of a file, in the file's order.
pub(super) fn all(parts: &[Part]) -> Vec<Layer> {
    let mut layers = Vec::new();
    for (index, part) in parts.iter().enumerate() {
        let mut prefixes: Vec<String> = Vec::new();
        for channel in &part.channels.list {
            let prefix = split(&channel.name.to_string()).0.to_owned();
            if !prefixes.contains(&prefix) {
                prefixes.push(prefix);
            }
        }
        // A part of one layer is known by the part's name, whatever its channels are called.
        let alone = prefixes.len() == 1;
        for prefix in prefixes {
            layers.push(layer_of(parts.len() > 1, alone, index, part, &prefix));
        }
    }
    layers
}

/// The layer that `wanted` means; without a name the first unprefixed colours, else the first colours, else the first.
pub(super) fn choose(layers: &[Layer], parts: &[Part], wanted: Option<&str>) -> Result<Layer, Fault> {
    let chosen = if let Some(wanted) = wanted {
        let found = named(layers, wanted).cloned().or_else(|| single_channel(parts, wanted));
        found.ok_or_else(|| {
            let labels = layers.iter().map(|layer| match layer.label.as_str() {
                "" => "(the unnamed one)".to_owned(),
                label => format!("`{label}`"),
            });
            let available = labels.collect::<Vec<_>>().join(", ");
            Fault::NoSuchLayer { wanted: wanted.to_owned(), available }
        })?
    } else {
        let colour = |layer: &&Layer| layer.meaning != Meaning::Values && layer.obstacle.is_none();
        let default = layers
            .iter()
            .find(|layer| layer.unprefixed && colour(layer))
            .or_else(|| layers.iter().find(colour))
            .or_else(|| layers.iter().find(|layer| layer.obstacle.is_none()))
            .or(layers.first());
        default.cloned().ok_or_else(|| Fault::damaged("it has no channels"))?
    };
    match chosen.obstacle {
        Some(obstacle) => Err(Fault::unsupported(obstacle)),
        None => Ok(chosen),
    }
}

fn named<'a>(layers: &'a [Layer], wanted: &str) -> Option<&'a Layer> {
    let by_label = |layer: &&Layer| layer.label == wanted;
    let by_alias = |layer: &&Layer| layer.aliases.iter().any(|alias| alias == wanted);
    let colour = |layer: &&Layer| layer.meaning != Meaning::Values;
    let loosely = |layer: &&Layer| layer.label.eq_ignore_ascii_case(wanted);
    (layers.iter().find(by_label))
        // A view names several parts (its colours, its depth): the colours are meant.
        .or_else(|| layers.iter().filter(by_alias).find(colour))
        .or_else(|| layers.iter().find(by_alias))
        .or_else(|| layers.iter().find(loosely))
}

fn single_channel(parts: &[Part], wanted: &str) -> Option<Layer> {
    parts.iter().enumerate().find_map(|(index, part)| {
        let channel = part.channels.list.iter().position(|channel| {
            let name = channel.name.to_string();
            let in_part = part_name(part).is_some_and(|part| wanted == format!("{part}.{name}"));
            name == wanted || in_part
        })?;
        let subsampled = part.channels.list[channel].sampling != exr::math::Vec2(1, 1);
        Some(Layer {
            part: index,
            label: wanted.to_owned(),
            aliases: Vec::new(),
            unprefixed: false,
            meaning: Meaning::Values,
            channels: vec![Some(channel)],
            obstacle: subsampled.then(|| format!("channel `{wanted}` is subsampled")),
        })
    })
}

fn layer_of(multipart: bool, alone: bool, index: usize, part: &Part, prefix: &str) -> Layer {
    let name = part_name(part);
    let label = match &name {
        Some(name) if multipart && (alone || prefix.is_empty() || prefix == name) => name.clone(),
        Some(name) if multipart => format!("{name}.{prefix}"),
        _ => prefix.to_owned(),
    };
    let mut aliases = vec![prefix.to_owned()];
    let own = &part.own_attributes;
    aliases.extend(name.filter(|_| prefix.is_empty()));
    if prefix.is_empty() {
        aliases.extend(own.view_name.as_ref().map(ToString::to_string));
        // The first view of a `multiView` file has the unprefixed channels.
        aliases.extend(own.multi_view_names.as_ref().and_then(|views| views.first()).map(ToString::to_string));
    }
    aliases.retain(|alias| !alias.is_empty() && *alias != label);

    let (meaning, channels, obstacle) = pick(part, prefix);
    Layer { part: index, label, aliases, unprefixed: prefix.is_empty(), meaning, channels, obstacle }
}

/// Chooses the channels of the layer `prefix` that make a picture.
fn pick(part: &Part, prefix: &str) -> (Meaning, Vec<Option<usize>>, Option<String>) {
    let members: Vec<(usize, String)> = part
        .channels
        .list
        .iter()
        .enumerate()
        .filter_map(|(index, channel)| {
            let name = channel.name.to_string();
            let (own, base) = split(&name);
            (own == prefix).then(|| (index, base.to_ascii_lowercase()))
        })
        .collect();
    let find = |names: &[&str]| members.iter().find(|(_, base)| names.contains(&base.as_str())).map(|(i, _)| *i);
    let (r, g, b) = (find(&["r", "red"]), find(&["g", "green"]), find(&["b", "blue"]));
    let alpha = find(&["a", "alpha"]);
    let (x, y, z) = (find(&["x"]), find(&["y"]), find(&["z"]));
    let with_alpha = |mut channels: Vec<Option<usize>>| {
        channels.extend(alpha.map(Some));
        channels
    };

    let (meaning, channels) = match [r, g, b].iter().flatten().count() {
        2 | 3 => (Meaning::Colour, with_alpha(vec![r, g, b])),
        1 => (Meaning::Values, with_alpha(vec![r.or(g).or(b)])),
        _ => match (x, y, z, find(&["ry"]), find(&["by"])) {
            (_, Some(_), _, Some(ry), Some(by)) => (Meaning::LuminanceChroma, with_alpha(vec![y, Some(ry), Some(by)])),
            // A vector's components. Without an X, a Y is luminance, and a Z beside it is depth.
            (Some(_), Some(_), ..) => (Meaning::Values, vec![x, y, z]),
            (_, Some(_), ..) => (Meaning::Colour, with_alpha(vec![y])),
            _ => {
                let others: Vec<_> = members.iter().map(|(i, _)| *i).filter(|i| Some(*i) != alpha).map(Some).collect();
                match others.len() {
                    0 => (Meaning::Values, vec![alpha]),
                    1 => (Meaning::Values, with_alpha(others)),
                    2 => (Meaning::Values, [others, vec![None]].concat()),
                    3 => (Meaning::Values, others),
                    _ => {
                        let names: Vec<_> = members.iter().map(|(i, _)| part.channels.list[*i].name.to_string()).collect();
                        let names = names.join(", ");
                        let reason = format!("a layer of the channels {names}; choose one of them after a `#`");
                        return (Meaning::Values, others, Some(reason));
                    }
                }
            }
        },
    };
    let subsampled = |index: &usize| part.channels.list[*index].sampling != exr::math::Vec2(1, 1);
    let obstacle = (meaning != Meaning::LuminanceChroma && channels.iter().flatten().any(subsampled))
        .then(|| "subsampled channels that are not luminance and chroma".to_owned());
    (meaning, channels, obstacle)
}

/// `diffuse.left.R` → (`diffuse.left`, `R`).
fn split(name: &str) -> (&str, &str) {
    name.rsplit_once('.').unwrap_or(("", name))
}

fn part_name(part: &Part) -> Option<String> {
    part.own_attributes.layer_name.as_ref().map(ToString::to_string).filter(|name| !name.is_empty())
}
