//! Which part of an image is held while one tile is made.
//!
//! A tile is a rectangle of the images of a [`Tiling`](crate::kernel_pass::TilingOp). A *window* is what a resource must
//! hold for it: the tile, wider on each side by what later passes look at around their pixels, and cut at the image's
//! edges. Kernels keep counting in pixels of the whole image; what a window's origin is, they are told in uniforms.

use std::collections::BTreeMap;
use std::ops::Range;

use pipe_graph::pass::ResourceId;

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

    pub(crate) fn plus(self, other: Self) -> Self {
        let add = |a: [u32; 2], b: [u32; 2]| [a[0].saturating_add(b[0]), a[1].saturating_add(b[1])];
        Self { before: add(self.before, other.before), after: add(self.after, other.after) }
    }

    pub(crate) fn union(self, other: Self) -> Self {
        let max = |a: [u32; 2], b: [u32; 2]| [a[0].max(b[0]), a[1].max(b[1])];
        Self { before: max(self.before, other.before), after: max(self.after, other.after) }
    }

    /// A multiple of it.
    pub(crate) fn times(self, n: u32) -> Self {
        let all = |a: [u32; 2]| a.map(|v| v.saturating_mul(n));
        Self { before: all(self.before), after: all(self.after) }
    }
}

/// The tiles of an image and the windows of everything that is held for one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Windows {
    /// Width and height of the images.
    pub(crate) size: [u32; 2],
    /// Width and height of a tile that no edge cuts.
    pub(crate) step: [u32; 2],
    /// How far each window reaches; what is not here is held whole.
    pub(crate) halos: BTreeMap<ResourceId, Halo>,
}

impl Windows {
    /// The tiles, row by row.
    pub(crate) fn tiles(&self) -> Vec<Rect> {
        let cut = |axis: usize| -> Vec<Range<u32>> {
            (0..self.size[axis])
                .step_by(self.step[axis] as usize)
                .map(|first| first..first.saturating_add(self.step[axis]).min(self.size[axis]))
                .collect()
        };
        let columns = cut(0);
        cut(1).into_iter().flat_map(|y| columns.iter().map(move |x| Rect { x: x.clone(), y: y.clone() })).collect()
    }

    /// What a window that reaches so far covers for a tile.
    pub(crate) fn widened(&self, tile: &Rect, halo: Halo) -> Rect {
        let axis = |range: &Range<u32>, i: usize| {
            range.start.saturating_sub(halo.before[i])..range.end.saturating_add(halo.after[i]).min(self.size[i])
        };
        Rect { x: axis(&tile.x, 0), y: axis(&tile.y, 1) }
    }

    /// What a resource holds for a tile; `None` when it is held whole.
    pub(crate) fn window(&self, id: ResourceId, tile: &Rect) -> Option<Rect> {
        self.halos.get(&id).map(|halo| self.widened(tile, *halo))
    }

    /// The part of a resource that belongs to a tile: its window, or the tile itself of what is held whole.
    pub(crate) fn part(&self, id: ResourceId, tile: &Rect) -> Rect {
        self.window(id, tile).unwrap_or_else(|| tile.clone())
    }

    /// The size that fits the window of every tile.
    pub(crate) fn largest(&self, halo: Halo) -> [u32; 2] {
        let one = |i: usize| self.step[i].saturating_add(halo.before[i]).saturating_add(halo.after[i]).min(self.size[i]);
        [one(0), one(1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_the_image_once_and_windows_stay_inside() {
        let windows = Windows { size: [61, 47], step: [32, 16], halos: BTreeMap::new() };
        let tiles = windows.tiles();
        assert_eq!(tiles.len(), 6);
        assert_eq!(tiles.iter().map(Rect::area).sum::<u64>(), 61 * 47);
        let halo = Halo { before: [3, 5], after: [1, 20] };
        for tile in &tiles {
            let w = windows.widened(tile, halo);
            assert!(w.x.start <= tile.x.start && w.x.end >= tile.x.end && w.x.end <= 61 && w.y.end <= 47);
            let most = windows.largest(halo);
            assert!(w.size()[0] <= most[0] && w.size()[1] <= most[1]);
        }
    }
}
