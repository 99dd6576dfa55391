//! The graphs shipped with the program.

/// File name and text of every file in `graphs/`: graphs and the shaders that they use.
pub const FILES: &[(&str, &str)] = &include!(concat!(env!("OUT_DIR"), "/presets.rs"));

/// The text of a shipped file: `tone-map` or `tone-map.ron`.
pub fn text(name: &str) -> Option<&'static str> {
    let find = |name: &str| FILES.iter().find(|(n, _)| *n == name).map(|(_, text)| *text);
    find(name).or_else(|| find(&format!("{name}.ron")))
}

/// Names of the graphs, without the ending.
pub fn names() -> impl Iterator<Item = &'static str> {
    FILES.iter().filter_map(|(name, _)| name.strip_suffix(".ron"))
}
