//! `HistogramMatch`: gives an image the distribution of another.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::bins::{self, Binning, Channel, Outside, UNIT, check_range};
use super::prefix::{FAST_RADIX, scan};
use crate::shader;

/// Gives each colour channel of an image the distribution that it has in a reference image, as film stocks or
/// cameras are matched; an image of 1 channel gets that of the reference's luminance. Alpha is kept. The images need
/// not be of one size.
///
/// A value at which a share c of the image's pixels lies below becomes the value at which the same share of the
/// reference's pixels does. Both shares come from histograms of `bins` bins, and are taken to grow evenly inside a
/// bin. Values outside the range are brought to its ends.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct HistogramMatch {
    /// The image to change.
    image: In<Image>,
    /// The image whose distribution is taken over.
    reference: In<Image>,
    /// How many bins the histograms have.
    #[default = 256]
    #[schemars(range(min = 2, max = 65536))]
    bins: u32,
    /// The values that the histograms span: `(lo, hi)`, lo < hi.
    #[default(UNIT)]
    range: (f32, f32),
}

pub(crate) const KIND: Kind = Kind::of::<HistogramMatch>(
    "HistogramMatch",
    Category::Analysis,
    &[
        r#"HistogramMatch(image: "in", reference: "other")"#,
        r#"HistogramMatch(image: "grey", reference: "other", bins: 1000)"#,
        r#"HistogramMatch(image: "in", reference: "grey", bins: 64, range: (-0.5, 9))"#,
        r#"HistogramMatch(image: "pair", reference: "in", bins: 65536)"#,
    ],
);

impl Node for HistogramMatch {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        check_range(self.range)
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, reference, out) = (cx.input(&self.image), cx.input(&self.reference), cx.output("out"));
        let channels = matched(cx.image_of(image).channels);
        let mut curves = Vec::new();
        for channel in channels {
            let mut cumulative = |what: &str, of: ResourceId| {
                let counts = bins::count(cx, &format!("{what}.{channel:?}"), of, &self.binning(*channel));
                scan(cx, &format!("{what}.{channel:?}.cdf"), counts, true, FAST_RADIX)
            };
            let (own, wanted) = (cumulative("image", image), cumulative("reference", reference));
            let curve = cx.intermediate(&format!("curve.{channel:?}"), Shape::floats(2 * self.bins));
            cx.pass(&format!("curve.{channel:?}"), shader!("analysis/match_curve"))
                .entry(Entry::At)
                .read("own", own, Reach::Whole)
                .read("wanted", wanted, Reach::Whole)
                .write("out", curve)
                .param("low", self.range.0)
                .param("high", self.range.1)
                .add();
            curves.push(curve);
        }
        let mut pass = cx.pass("", shader!("analysis/match")).entry(Entry::Point).read("image", image, Reach::Point);
        for (i, port) in ["red", "green", "blue"].into_iter().enumerate() {
            pass = pass.read(port, curves[i.min(curves.len() - 1)], Reach::Whole);
        }
        pass.write("out", out).constant("BINS", self.bins as i32).param("low", self.range.0).param("high", self.range.1).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (image, reference) = (cx.image(&self.image), cx.image(&self.reference));
        let [low, high] = [self.range.0, self.range.1].map(f64::from);
        let channels = matched(image.channels);
        let cumulative = |of: &Raster, channel: Channel| {
            let mut sum = 0;
            let counts = self.binning(channel).count_reference(of, low, high);
            counts
                .iter()
                .map(|n| {
                    sum += n;
                    sum
                })
                .collect::<Vec<u64>>()
        };
        let curves: Vec<_> = channels.iter().map(|c| Curve { own: cumulative(image, *c), wanted: cumulative(reference, *c) }).collect();
        vec![Tensor::Image(image.map(image.channels, |c| {
            let value = |v: f64, curve: &Curve| {
                let Some(bin) = self.binning(Channel::R).bin(v, low, high) else { return v };
                let n = f64::from(self.bins);
                let inside = ((v - low) / (high - low) * n - bin as f64).clamp(0.0, 1.0);
                let [a, b] = [curve.share(bin, false), curve.share(bin, true)].map(|p| low + p / n * (high - low));
                a + inside * (b - a)
            };
            let at = |i: usize| &curves[i.min(curves.len() - 1)];
            [value(c[0], at(0)), value(c[1], at(1)), value(c[2], at(2)), c[3]]
        }))]
    }
}

/// The channels that are matched: alpha is none.
const fn matched(channels: u8) -> &'static [Channel] {
    match channels {
        1 => &[Channel::Luminance],
        2 => &[Channel::R, Channel::G],
        _ => &[Channel::R, Channel::G, Channel::B],
    }
}

/// Cumulative counts of one channel in both images.
struct Curve {
    own: Vec<u64>,
    wanted: Vec<u64>,
}

impl Curve {
    /// Where, in bins, the reference reaches the share that the image has at one end of a bin. At the lower end of
    /// a bin a gap in the reference is behind, at the upper end it is still ahead.
    fn share(&self, bin: usize, upper: bool) -> f64 {
        let last = self.own.len() - 1;
        let (n, m) = (u128::from(self.own[last]), u128::from(self.wanted[last]));
        if n == 0 || m == 0 {
            return (bin + usize::from(upper)) as f64;
        }
        let below = |i: usize| if i == 0 { 0 } else { u128::from(self.wanted[i - 1]) };
        let count = if upper {
            self.own[bin]
        } else if bin == 0 {
            0
        } else {
            self.own[bin - 1]
        };
        let c = u128::from(count) * m;
        let strictly = !upper && c < n * m;
        let holds = |i: &usize| {
            let reached = u128::from(self.wanted[*i]) * n;
            if strictly { reached > c } else { reached >= c }
        };
        let j = (0..=last).find(holds).unwrap_or(last);
        let height = (u128::from(self.wanted[j]) - below(j)) * n;
        j as f64 + if height == 0 { 0.0 } else { (c - below(j) * n) as f64 / height as f64 }
    }
}

impl HistogramMatch {
    fn binning(&self, channel: Channel) -> Binning {
        Binning { bins: self.bins, low: self.range.0.into(), high: self.range.1.into(), channel, outside: Outside::Clamp }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_step_over_gaps() {
        // The reference has pixels in bins 1 and 3 only, two in each; the image one in each bin.
        let curve = Curve { own: vec![1, 2, 3, 4], wanted: vec![0, 2, 2, 4] };
        let ends: Vec<_> = (0..4).map(|bin| (curve.share(bin, false), curve.share(bin, true))).collect();
        assert_eq!(ends, [(1.0, 1.5), (1.5, 2.0), (3.0, 3.5), (3.5, 4.0)]);
    }
}
