//! Order statistics of an image, exact: a radix select over the bits of the floats.
//!
//! Floats are ordered by their bits once the sign is dealt with, so the value of a rank is found from its highest
//! digit to its lowest: each of four passes counts one digit of 8 bits of all values that agree with the digits
//! found so far, and a small kernel walks the counts. A fifth pass finds the next larger value, to interpolate as
//! `numpy.percentile` does: at rank h = (n − 1)·q, v[⌊h⌋] + (h − ⌊h⌋)·(v[⌊h⌋ + 1] − v[⌊h⌋]). Rejected: sorting (n log n
//! bytes moved) and a fine histogram (its error depends on the range). NaN and ±infinity take no part.

use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;

use super::reduction::{View, walk};
use crate::shader;

/// Bits of a digit: 256 counts for each quantile and component, which workgroup memory holds.
const DIGIT: u32 = 8;

/// The quantiles `fractions` (0..1, at most 3) of the components of a view: one scalar each.
pub(crate) fn quantiles(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, view: View, fractions: &[f64]) -> Vec<ResourceId> {
    let components: u32 = match view {
        View::Luminance => 1,
        View::Channels => cx.image_of(image).channels.into(),
        View::ColourAndLuminance => 4,
    };
    let targets = fractions.len() as u32;
    let walk = walk(cx.image_of(image).size, cx.limits().profile);
    let digits: Vec<u32> = fractions.iter().copied().map(fixed_point).collect();
    let wanted = cx.uints(&format!("{suffix}.fractions"), &digits);
    let add = |pass: PassBuilder<'_, '_>| {
        pass.constant("COMPONENTS", components as i32).constant("TARGETS", targets as i32).add();
    };
    // For each target: the digits found so far, the rank among the values that share them, the fraction to
    // interpolate by, and whether the next larger value is the same.
    let state = Shape::uints(4 * targets * components);
    let mut found = cx.uints(&format!("{suffix}.start"), &vec![0; (4 * targets * components) as usize]);
    for round in 0..32 / DIGIT {
        let counts = cx.intermediate(&format!("{suffix}.counts{round}"), Shape::uints((targets * components) << DIGIT));
        // In the first round all quantiles ask for the same counts.
        let sets = if round == 0 { components } else { targets * components };
        let pass = cx
            .pass(&format!("{suffix}.count{round}"), shader!("analysis/quantile_count"))
            .entry(Entry::Fold(Workspace { own: sets << (DIGIT + 2), scratch: 0 }))
            .grid(Grid::Walk(walk))
            .read_once("image", image)
            .read("state", found, Reach::Whole)
            .write_as("counts", counts, Access::Atomic, None)
            .constant("VIEW", view as i32)
            .constant("ROUND", round);
        add(pass);
        let next = cx.intermediate(&format!("{suffix}.digits{round}"), state);
        let pass = cx
            .pass(&format!("{suffix}.digit{round}"), shader!("analysis/quantile_digit"))
            .entry(Entry::Kernel)
            .read("counts", counts, Reach::Whole)
            .read("state", found, Reach::Whole)
            .read("fractions", wanted, Reach::Whole)
            .write("next", next)
            .constant("ROUND", round)
            .grid(Grid::Groups([targets * components, 1, 1]));
        add(pass);
        found = next;
    }
    let above = cx.intermediate(&format!("{suffix}.above"), Shape::uints(targets * components));
    let pass = cx
        .pass(&format!("{suffix}.next"), shader!("analysis/quantile_next"))
        .entry(Entry::Fold(Workspace { own: 4 * targets * components, scratch: 0 }))
        .grid(Grid::Walk(walk))
        .read_once("image", image)
        .read("state", found, Reach::Whole)
        .write_as("above", above, Access::Atomic, None)
        .constant("VIEW", view as i32);
    add(pass);
    let mut outs = Vec::new();
    for target in 0..targets {
        let out = cx.intermediate(&format!("{suffix}.{target}"), Shape::Scalar);
        let pass = cx
            .pass(&format!("{suffix}.value{target}"), shader!("analysis/quantile_value"))
            .entry(Entry::Kernel)
            .read("state", found, Reach::Whole)
            .read("above", above, Reach::Whole)
            .write("out", out)
            .constant("TARGET", target as i32)
            .grid(Grid::Groups([1, 1, 1]));
        add(pass);
        outs.push(out);
    }
    outs
}

/// A fraction in units of 2⁻³²; 1 is the largest there is.
fn fixed_point(fraction: f64) -> u32 {
    (fraction * 4_294_967_296.0).round().clamp(0.0, f64::from(u32::MAX)) as u32
}

/// The twin: `numpy.percentile` with linear interpolation; 0 without values.
pub(crate) fn quantile_reference(values: &[f64], fraction: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let rank = last as f64 * fraction;
    let below = sorted[rank.floor() as usize];
    let above = sorted[(rank.floor() as usize + 1).min(last)];
    below + rank.fract() * (above - below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_twin_interpolates_as_numpy_does() {
        // numpy.percentile([3, 1, 4, 1, 5, 9, 2, 6], [1, 50, 99])
        let values = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0];
        for (fraction, expected) in [(0.01, 1.0), (0.5, 3.5), (0.99, 8.79), (1.0, 9.0), (0.0, 1.0)] {
            assert!((quantile_reference(&values, fraction) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn fractions_are_fixed_point() {
        assert_eq!(fixed_point(0.5), 1 << 31);
        assert_eq!(fixed_point(0.0), 0);
        assert_eq!(fixed_point(1.0), u32::MAX);
    }
}
