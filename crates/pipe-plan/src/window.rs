//! Which part of an image is held while one tile is made.
//!
//! A tile is a rectangle of the images of a [`Tiling`](crate::kernel_pass::TilingOp). A *window* is what a resource must
//! hold for it: the tile, wider on each side by what later passes look at around their pixels, and cut at the image's
//! edges. Where a later pass looks elsewhere (it resizes, it crops, it turns) the window lies there, in an image of another
//! size.
//! Kernels keep counting in pixels of the whole image; what a window's origin is, they are told in uniforms.

use std::collections::BTreeMap;
use std::ops::Range;

use pipe_graph::pass::{Border, ResourceId, Stretch};

use crate::plan::Rect;

/// How far a window reaches beyond a tile, along x and y.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Halo {
    pub(crate) before: [u32; 2],
    pub(crate) after: [u32; 2],
}

impl Halo {
    /// As far on both sides.
    pub(crate) const fn around(reach: [u32; 2]) -> Self {
        Self { before: reach, after: reach }
    }

    /// A multiple of it.
    pub(crate) fn times(self, n: u32) -> Self {
        let all = |a: [u32; 2]| a.map(|v| v.saturating_mul(n));
        Self { before: all(self.before), after: all(self.after) }
    }
}

/// The windows of a resource, one for each tile.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct View {
    /// Width and height of the resource.
    pub(crate) size: [u32; 2],
    axes: [Cuts; 2],
}

/// Where the windows lie along one axis of a resource.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Cuts {
    /// The axis of the tiles that decides: 0 for their columns, 1 for their rows. Quarter turns exchange them.
    by: usize,
    /// For each column, or row.
    ranges: Vec<Range<u32>>,
}

impl View {
    /// The tiles themselves, of an image of this size.
    pub(crate) fn tiles(size: [u32; 2], step: [u32; 2]) -> Self {
        let cut = |by: usize| {
            let firsts = (0..size[by]).step_by(step[by] as usize);
            Cuts { by, ranges: firsts.map(|first| first..first.saturating_add(step[by]).min(size[by])).collect() }
        };
        Self { size, axes: [0, 1].map(cut) }
    }

    /// Wider by a halo, in an image of the same size.
    pub(crate) fn plus(mut self, halo: Halo) -> Self {
        for (i, axis) in self.axes.iter_mut().enumerate() {
            for range in &mut axis.ranges {
                *range = range.start.saturating_sub(halo.before[i])..range.end.saturating_add(halo.after[i]).min(self.size[i]);
            }
        }
        self
    }

    /// What all of its pixels look at in an image of this size.
    pub(crate) fn through(&self, looks: [Stretch; 2], border: Border, size: [u32; 2]) -> Self {
        let axes = [0, 1].map(|i: usize| {
            let Cuts { by, ranges } = &self.axes[looks[i].along];
            Cuts { by: *by, ranges: ranges.iter().map(|range| seen(range, looks[i], border, size[i])).collect() }
        });
        Self { size, axes }
    }

    /// Wider, so that it holds another as well.
    pub(crate) fn unite(&mut self, other: &Self) {
        for ((axis, other), size) in self.axes.iter_mut().zip(&other.axes).zip(self.size) {
            if axis.by == other.by {
                for (range, other) in axis.ranges.iter_mut().zip(&other.ranges) {
                    *range = range.start.min(other.start)..range.end.max(other.end);
                }
            } else {
                // The same image turned and as it is: together, a tile may need anything.
                axis.ranges.fill(0..size);
            }
        }
    }

    /// The window of a tile, by its column and row.
    fn window(&self, tile: [usize; 2]) -> Rect {
        let [x, y] = [0, 1].map(|i: usize| self.axes[i].ranges[tile[self.axes[i].by]].clone());
        Rect { x, y }
    }

    /// The size that fits every window.
    pub(crate) fn largest(&self) -> [u32; 2] {
        [0, 1].map(|i: usize| self.axes[i].ranges.iter().map(|range| range.end - range.start).max().unwrap_or(0))
    }

    /// Pixels of all windows together.
    pub(crate) fn area(&self) -> f64 {
        self.axes.iter().map(|axis| axis.ranges.iter().map(|range| f64::from(range.end - range.start)).sum::<f64>()).product()
    }
}

/// What the pixels of a range look at along an axis of so many pixels.
fn seen(range: &Range<u32>, look: Stretch, border: Border, size: u32) -> Range<u32> {
    let ends = [range.start, range.end.saturating_sub(1)].map(|i| look.first_of(i));
    let (first, end) = (ends[0].min(ends[1]), ends[0].max(ends[1]) + i64::from(look.count));
    let size = i64::from(size);
    let (mut start, mut stop) = (first.clamp(0, size - 1), end.clamp(1, size));
    if border == Border::Mirror {
        // What lies outside is a reflection of as much inside.
        start = start.min(2 * size - end).max(0);
        stop = stop.max(-first).min(size);
    }
    // Of what lies outside, the pixel at the edge is what a border makes most of.
    start as u32..stop.max(start + 1) as u32
}

/// The tiles of an image and the windows of everything that is held for one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Windows {
    /// Width and height of the images.
    pub(crate) size: [u32; 2],
    /// Width and height of a tile that no edge cuts.
    pub(crate) step: [u32; 2],
    /// What is not here is held whole.
    pub(crate) views: BTreeMap<ResourceId, View>,
}

impl Windows {
    /// The tiles, row by row.
    pub(crate) fn tiles(&self) -> Vec<Rect> {
        let [columns, rows] = View::tiles(self.size, self.step).axes;
        let row = |y: &Range<u32>| columns.ranges.iter().map(|x| Rect { x: x.clone(), y: y.clone() }).collect::<Vec<_>>();
        rows.ranges.iter().flat_map(row).collect()
    }

    /// What a resource holds for a tile; `None` when it is held whole.
    pub(crate) fn window(&self, id: ResourceId, tile: &Rect) -> Option<Rect> {
        let at = [tile.x.start / self.step[0], tile.y.start / self.step[1]];
        Some(self.views.get(&id)?.window(at.map(|n| n as usize)))
    }

    /// The part of a resource that belongs to a tile: its window, or the tile itself of what is held whole.
    pub(crate) fn part(&self, id: ResourceId, tile: &Rect) -> Rect {
        self.window(id, tile).unwrap_or_else(|| tile.clone())
    }

    /// Width and height of a resource.
    pub(crate) fn size_of(&self, id: ResourceId) -> [u32; 2] {
        self.views.get(&id).map_or(self.size, |view| view.size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_the_image_once_and_windows_stay_inside() {
        let id = ResourceId(0);
        let view = View::tiles([61, 47], [32, 16]).plus(Halo { before: [3, 5], after: [1, 20] });
        let most = view.largest();
        let windows = Windows { size: [61, 47], step: [32, 16], views: [(id, view)].into() };
        let tiles = windows.tiles();
        assert_eq!(tiles.len(), 6);
        assert_eq!(tiles.iter().map(Rect::area).sum::<u64>(), 61 * 47);
        for tile in &tiles {
            let w = windows.part(id, tile);
            assert!(w.x.start <= tile.x.start && w.x.end >= tile.x.end && w.x.end <= 61 && w.y.end <= 47);
            assert!(w.size()[0] <= most[0] && w.size()[1] <= most[1]);
        }
    }

    #[test]
    fn a_window_elsewhere_holds_what_every_pixel_looks_at() {
        let stretch = |num, den, first, count| Stretch { along: 0, num, den, first, count };
        let clamped = |x: i64| x.clamp(0, 99);
        let mirrored = |x: i64| if x < 0 { -1 - x } else { x.min(199 - x) };
        for look in [stretch(5, 2, -4, 10), stretch(-5, 2, 104, 3), Stretch::mirrored(0, 100), stretch(1, 3, 90, 20)] {
            for range in [0..1_u32, 0..16, 16..31, 39..40] {
                let windows = [Border::Clamp, Border::Mirror].map(|border| seen(&range, look, border, 100));
                for i in range {
                    let places = look.first_of(i)..look.first_of(i) + i64::from(look.count);
                    assert!(places.clone().all(|x| windows[0].contains(&(clamped(x) as u32))), "{windows:?} {look:?} {i}");
                    assert!(places.clone().all(|x| windows[1].contains(&(mirrored(x) as u32))), "{windows:?} {look:?} {i}");
                }
            }
        }
        let shifted = |range: Range<u32>| seen(&range, Stretch::shift(0, -70), Border::Clamp, 20);
        assert_eq!([shifted(0..4), shifted(90..94), shifted(60..80)], [0..1, 19..20, 0..10]);
        assert_eq!(seen(&(7..9), stretch(1, 3, 0, 1), Border::Clamp, 20), 2..3);
        assert_eq!(seen(&(0..5), Stretch::mirrored(0, 20), Border::Clamp, 20), 15..20);
    }

    #[test]
    fn quarter_turns_exchange_columns_and_rows() {
        let (size, step) = ([8, 20], [4, 5]);
        let turned = View::tiles(size, step).through([Stretch::shift(1, 0), Stretch::mirrored(0, 8)], Border::Clamp, [20, 8]);
        assert_eq!(turned.window([0, 3]), Rect { x: 15..20, y: 4..8 });
        let mut both = View::tiles([20, 20], step).through([Stretch::shift(1, 0), Stretch::shift(0, 0)], Border::Clamp, [20, 20]);
        both.unite(&View::tiles([20, 20], step));
        assert_eq!(both.window([4, 2]), Rect { x: 0..20, y: 0..20 });
    }
}
