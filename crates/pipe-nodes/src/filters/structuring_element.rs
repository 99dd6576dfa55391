//! The largest or smallest value in a square or a disk, built up from few values at a time.
//!
//! A pass takes the extreme of the image at a list of offsets. The extreme over 2h + 1 pixels in a row, taken at steps of at
//! most h + 1, is the extreme over a longer row. So a square of radius r takes ⌈log(r + 1)/log 5⌉ passes of at most nine
//! loads along each axis, where van Herk's algorithm (1992) would take two passes and serial scans. A disk is a stack of
//! rows, as in E. Urbach and M. Wilkinson, Efficient 2-D Grayscale Morphological Transformations with Arbitrary Flat
//! Structuring Elements (IEEE Trans. Image Processing 17, 2008): rows of radius 0, 1, 3, 7, 15 … are made from one another,
//! and each row of the disk is put together from the longest that fit in it.
//!
//! Borders come out right although each pass applies the policy anew: what is beyond the edge of an intermediate result is
//! what the same rows would give there, or, beyond a black edge, 0, which the longer row contains; and since steps are not
//! longer than h + 1, the rows that begin inside still cover all of it.

use pipe_graph::prelude::*;

use crate::shader;

/// The shape of a neighbourhood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub(super) enum Element {
    /// |x| ≤ r and |y| ≤ r
    #[default]
    Square,
    /// x² + y² ≤ r²
    Disk,
}

/// Which value of a neighbourhood is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Extreme {
    /// The largest: dilation.
    Largest,
    /// The smallest: erosion.
    Smallest,
}

impl Element {
    /// Half the width of the row at distance `dy` from the centre.
    fn half_width(self, radius: u32, dy: u32) -> u32 {
        match self {
            Self::Square => radius,
            Self::Disk => (radius * radius - dy * dy).isqrt(),
        }
    }
}

/// Steps to either side in a pass along one axis.
const STEPS: u32 = 4;

/// The largest disk that is looked at pixel by pixel.
const SMALL_DISK: u32 = 3;

/// Offsets at which rows of radius `half` cover a row of radius `wide`.
fn cover(half: u32, wide: u32) -> impl Iterator<Item = i32> {
    let (end, step) = ((wide - half) as i32, half as i32 + 1);
    let steps = (wide - half).div_ceil(half + 1) as i32;
    (-steps..=steps).map(move |i| (i * step).clamp(-end, end))
}

/// Declares the extreme of `so_far` at the pixel and of `image` at these offsets from it.
fn extreme(cx: &mut Lowering<'_>, suffix: &str, taken: Extreme, offsets: &[[i32; 2]], [so_far, image, out]: [ResourceId; 3]) {
    let furthest = |axis: usize| offsets.iter().map(|o| o[axis].unsigned_abs()).max().unwrap_or(0);
    let numbers: Vec<f32> = offsets.iter().flatten().map(|o| *o as f32).collect();
    let table = cx.floats(&format!("{suffix}.offsets"), &numbers);
    cx.pass(suffix, shader!("filters/extreme"))
        .read("so_far", so_far, Reach::Point)
        .read("image", image, Reach::Around(furthest(0), furthest(1)))
        .read("offsets", table, Reach::Whole)
        .write("out", out)
        .constant("LARGEST", taken == Extreme::Largest)
        .add();
}

/// Declares the extreme of `image` over an element of this radius around each pixel.
pub(super) fn morph(
    cx: &mut Lowering<'_>,
    prefix: &str,
    taken: Extreme,
    (element, radius): (Element, u32),
    image: ResourceId,
    out: ResourceId,
) {
    match element {
        Element::Square => square(cx, prefix, taken, radius, image, out),
        Element::Disk => disk(cx, prefix, taken, radius, image, out),
    }
}

fn square(cx: &mut Lowering<'_>, prefix: &str, taken: Extreme, radius: u32, image: ResourceId, out: ResourceId) {
    let shape = cx.shape(out);
    let passes = radii(radius);
    let mut from = image;
    for (axis, name) in ["rows", "columns"].into_iter().enumerate() {
        for (i, pair) in passes.windows(2).enumerate() {
            let last = axis == 1 && i + 2 == passes.len();
            let to = if last { out } else { cx.intermediate(&format!("{prefix}{name}{i}"), shape) };
            let offsets: Vec<[i32; 2]> = cover(pair[0], pair[1]).map(|o| if axis == 0 { [o, 0] } else { [0, o] }).collect();
            extreme(cx, &format!("{prefix}{name}{i}"), taken, &offsets, [from, from, to]);
            from = to;
        }
    }
}

/// Radii after 0, 1, 2 … passes along one axis; a radius of 0 is one pass that copies.
fn radii(radius: u32) -> Vec<u32> {
    let mut radii = vec![0];
    let mut reached = 0;
    while reached < radius {
        reached = radius.min(reached + STEPS * (reached + 1));
        radii.push(reached);
    }
    if radius == 0 {
        radii.push(0);
    }
    radii
}

fn disk(cx: &mut Lowering<'_>, prefix: &str, taken: Extreme, radius: u32, image: ResourceId, out: ResourceId) {
    let shape = cx.shape(out);
    let levels = disk_levels(radius);
    let (mut rows, mut so_far) = (image, image);
    for (i, (half, offsets)) in levels.iter().enumerate() {
        if i > 0 {
            let wider = cx.intermediate(&format!("{prefix}rows{half}"), shape);
            let offsets: Vec<[i32; 2]> = cover(levels[i - 1].0, *half).map(|o| [o, 0]).collect();
            extreme(cx, &format!("{prefix}rows{half}"), taken, &offsets, [rows, rows, wider]);
            rows = wider;
        }
        let to = if i + 1 == levels.len() { out } else { cx.intermediate(&format!("{prefix}disk{half}"), shape) };
        extreme(cx, &format!("{prefix}disk{half}"), taken, offsets, [so_far, rows, to]);
        so_far = to;
    }
}

/// The rows of a disk by the radius of the rows they are made of: radius, and where those are taken.
fn disk_levels(radius: u32) -> Vec<(u32, Vec<[i32; 2]>)> {
    let halves: Vec<u32> = if radius <= SMALL_DISK {
        vec![0]
    } else {
        std::iter::successors(Some(0), |h| Some(2 * h + 1)).take_while(|h| *h <= radius).collect()
    };
    let mut levels: Vec<(u32, Vec<[i32; 2]>)> = halves.iter().map(|h| (*h, Vec::new())).collect();
    for dy in -(radius as i32)..=radius as i32 {
        let wide = Element::Disk.half_width(radius, dy.unsigned_abs());
        let (half, offsets) = levels.iter_mut().rev().find(|(h, _)| *h <= wide).expect("rows of radius 0 fit everywhere");
        offsets.extend(cover(*half, wide).map(|dx| [dx, dy]));
    }
    levels.retain(|(_, offsets)| !offsets.is_empty());
    levels
}

/// The twin: every pixel of the element.
pub(super) fn morph_reference(image: &Raster, taken: Extreme, (element, radius): (Element, u32), border: Border) -> Raster {
    let r = i64::from(radius);
    Raster::from_fn(image.size, image.channels, |x, y| {
        let mut best = image.at(x, y);
        for dy in -r..=r {
            let half = i64::from(element.half_width(radius, dy.unsigned_abs() as u32));
            for dx in -half..=half {
                let p = image.load(x + dx, y + dy, border);
                best = std::array::from_fn(|c| if taken == Extreme::Largest { best[c].max(p[c]) } else { best[c].min(p[c]) });
            }
        }
        best
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Rows of radius `half` at `offsets`, as a set of pixels.
    fn covered(half: u32, offsets: impl IntoIterator<Item = [i32; 2]>) -> BTreeSet<[i32; 2]> {
        let h = half as i32;
        offsets.into_iter().flat_map(|[x, y]| (-h..=h).map(move |i| [x + i, y])).collect()
    }

    #[test]
    fn rows_cover_longer_rows_in_steps_that_a_black_border_allows() {
        for radius in 0..300 {
            let radii = radii(radius);
            assert_eq!(radii.last(), Some(&radius));
            for pair in radii.windows(2) {
                let offsets: Vec<i32> = cover(pair[0], pair[1]).collect();
                assert!(offsets.len() <= 9 && offsets.windows(2).all(|o| o[1] - o[0] <= pair[0] as i32 + 1));
                let wide = pair[1] as i32;
                assert_eq!(covered(pair[0], offsets.into_iter().map(|o| [o, 0])), (-wide..=wide).map(|x| [x, 0]).collect());
            }
        }
    }

    #[test]
    fn levels_make_a_disk() {
        for radius in 0..70_i32 {
            let levels = disk_levels(radius as u32);
            let pixels: BTreeSet<_> = levels.iter().flat_map(|(half, offsets)| covered(*half, offsets.iter().copied())).collect();
            let square = (-radius..=radius).flat_map(|y| (-radius..=radius).map(move |x| [x, y]));
            assert_eq!(pixels, square.filter(|[x, y]| x * x + y * y <= radius * radius).collect(), "{radius}");
            assert!(radius < 8 || levels.iter().map(|(_, o)| o.len()).sum::<usize>() <= 3 * (2 * radius as usize + 1));
        }
    }
}
