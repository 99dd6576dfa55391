//! Sequences: file names with a frame number in them, and ranges of frames.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::error::{Error, Result};

/// A file name with a place for the frame number: `in.####.exr` or `in.%04d.exr`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Pattern {
    before: String,
    digits: usize,
    after: String,
}

impl Pattern {
    /// Finds the place for the number in the last component of a path; `None` where there is none. A run of `#` that
    /// follows an extension (`in.exr#layer`) is no such place.
    ///
    /// Errors: there are two places, or a `%` that is not `%d` or `%0Nd`.
    pub fn parse(text: &str) -> Result<Option<Self>> {
        let name_at = text.rfind(['/', '\\']).map_or(0, |at| at + 1);
        let (folder, name) = text.split_at(name_at);
        // A layer's name is no part of the pattern.
        let layer = crate::Source::parse(name).layer.map_or(0, |layer| layer.len() + 1);
        let (name, layer) = name.split_at(name.len() - layer);
        let hashes = place_of_hashes(name);
        let percent = name.find('%');
        let (at, length, digits) = match (hashes, percent) {
            (None, None) => return Ok(None),
            (Some((at, length)), None) => (at, length, length),
            (None, Some(at)) => {
                let rest = &name[at + 1..];
                let number = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
                let width: usize = rest[..number].parse().unwrap_or(if number == 0 { 1 } else { usize::MAX });
                let padded = number == 0 || rest.starts_with('0');
                if !rest[number..].starts_with('d') || !padded || width > 20 {
                    return Err(Error::argument(text, "a frame pattern: write `%04d` or `####` for the number"));
                }
                (at, number + 2, width.max(1))
            }
            (Some(_), Some(_)) => {
                return Err(Error::argument(text, "a frame pattern: it has both `#` and `%`; keep one"));
            }
        };
        let after = &name[at + length..];
        if place_of_hashes(after).is_some() || after.contains('%') {
            return Err(Error::argument(text, "a frame pattern: it has two places for the frame number; keep one"));
        }
        Ok(Some(Self { before: format!("{folder}{}", &name[..at]), digits, after: format!("{after}{layer}") }))
    }

    /// The file of a frame; the number is padded with zeros and grows beyond the padding.
    pub fn path(&self, frame: u32) -> PathBuf {
        PathBuf::from(self.name(frame))
    }

    /// The same as text, layer and all (`in.0007.exr#diffuse`).
    pub fn name(&self, frame: u32) -> String {
        format!("{}{frame:0width$}{}", self.before, self.after, width = self.digits)
    }

    /// The frame whose file has this name.
    pub fn frame(&self, name: &str) -> Option<u32> {
        let number = name.strip_prefix(&self.before)?.strip_suffix(&self.after)?.parse().ok()?;
        (self.name(number) == name).then_some(number)
    }

    /// The frames of a range that have no file, in order.
    pub fn missing(&self, frames: FrameRange) -> Vec<u32> {
        let exists = |frame: &u32| {
            let name = self.name(*frame);
            let source = crate::Source::parse(&name);
            source.path.as_deref().is_some_and(Path::exists)
        };
        frames.into_iter().filter(|frame| !exists(frame)).collect()
    }
}

/// First run of `#`: its place and length.
fn place_of_hashes(name: &str) -> Option<(usize, usize)> {
    let at = name.find('#')?;
    let length = name[at..].find(|c| c != '#').unwrap_or(name.len() - at);
    Some((at, length))
}

/// Frames `first` to `last` (both included) in steps: `1-100`, `1-100x5`, `7`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FrameRange {
    /// First frame.
    pub first: u32,
    /// Last frame, reached or not by the steps; at least `first`.
    pub last: u32,
    /// Frames from one to the next, at least 1.
    pub step: u32,
}

impl FrameRange {
    /// How many frames there are, at least 1.
    #[allow(clippy::len_without_is_empty)] // no range is empty
    pub const fn len(&self) -> usize {
        ((self.last - self.first) / self.step) as usize + 1
    }

    /// Whether a frame is one of them.
    pub const fn contains(&self, frame: u32) -> bool {
        self.first <= frame && frame <= self.last && (frame - self.first).is_multiple_of(self.step)
    }
}

impl FromStr for FrameRange {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refuse = |expected: &str| Error::argument(text, expected);
        let number = |word: &str| {
            let digits = !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit());
            word.parse::<u32>().ok().filter(|_| digits).ok_or_else(|| refuse("a range of frames: 1-100, 1-100x5 or 7"))
        };
        let (range, step) = match text.split_once('x') {
            Some((range, step)) => (range, number(step)?),
            None => (text, 1),
        };
        let (first, last) = match range.split_once('-') {
            Some((first, last)) => (number(first)?, number(last)?),
            None => (number(range)?, number(range)?),
        };
        if step == 0 {
            return Err(refuse("a range of frames: its step must be at least 1"));
        }
        if last < first {
            return Err(refuse(&format!("an ascending range of frames; write {last}-{first}")));
        }
        Ok(Self { first, last, step })
    }
}

impl IntoIterator for FrameRange {
    type Item = u32;
    type IntoIter = std::iter::StepBy<std::ops::RangeInclusive<u32>>;

    fn into_iter(self) -> Self::IntoIter {
        (self.first..=self.last).step_by(self.step as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(pattern: &str, frame: u32) -> String {
        Pattern::parse(pattern).unwrap().unwrap().name(frame)
    }

    #[test]
    fn both_spellings_name_the_same_files() {
        for pattern in ["a/in.####.exr", "a/in.%04d.exr"] {
            assert_eq!(name(pattern, 7), "a/in.0007.exr");
            assert_eq!(name(pattern, 12345), "a/in.12345.exr");
        }
        assert_eq!(name("f%d.png", 7), "f7.png");
        assert_eq!(name("in.##.exr#diffuse", 3), "in.03.exr#diffuse");
    }

    #[test]
    fn a_name_tells_its_frame() {
        let pattern = Pattern::parse("in.##.exr").unwrap().unwrap();
        for (name, frame) in
            [("in.07.exr", Some(7)), ("in.123.exr", Some(123)), ("in.7.exr", None), ("in.007.exr", None), ("in.+7.exr", None)]
        {
            assert_eq!(pattern.frame(name), frame, "{name}");
        }
        assert_eq!(Pattern::parse("in.#.in").unwrap().unwrap().frame("in.in"), None);
    }

    #[test]
    fn other_names_are_no_patterns() {
        assert_eq!(Pattern::parse("in.exr").unwrap(), None);
        assert_eq!(Pattern::parse("in.exr#diffuse").unwrap(), None);
        for wrong in ["in.##.##.exr", "in.%04d.%d.exr", "in.%4d.exr", "in.%s.exr", "a#%d.png"] {
            assert!(Pattern::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn ranges() {
        let frames = |text: &str| text.parse::<FrameRange>().unwrap().into_iter().collect::<Vec<_>>();
        assert_eq!(frames("7"), [7]);
        assert_eq!(frames("1-4"), [1, 2, 3, 4]);
        assert_eq!(frames("1-10x4"), [1, 5, 9]);
        assert_eq!((0..12).filter(|n| "1-10x4".parse::<FrameRange>().unwrap().contains(*n)).collect::<Vec<_>>(), [1, 5, 9]);
        assert_eq!("1-10x4".parse::<FrameRange>().unwrap().len(), 3);
        for wrong in ["", "5-1", "1-", "-3", "1-9x0", "a", "+1", "1-99999999999"] {
            assert!(wrong.parse::<FrameRange>().is_err(), "{wrong}");
        }
        assert!("5-1".parse::<FrameRange>().unwrap_err().to_string().contains("1-5"));
    }

    #[test]
    fn missing_frames_are_listed() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("f.02.exr"), "").unwrap();
        let pattern = format!("{}/f.##.exr#Z", folder.path().display());
        let pattern = Pattern::parse(&pattern).unwrap().unwrap();
        assert_eq!(pattern.missing("1-3".parse().unwrap()), [1, 3]);
    }
}
