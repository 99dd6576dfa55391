//! Reconstruction kernels, and what they come to for every pixel along one axis.
//!
//! An output pixel i looks at the input around c = (i + ½)·n/m. Where the image shrinks, the kernel is stretched by
//! n/m, so that every input pixel counts; weights are normalised to sum 1. Since (i + ½)·n/m is rational, weights
//! repeat every m/gcd(n, m) pixels: one small table per axis, computed here in double precision, serves an image of
//! any size. Rejected: computing weights in the shader (their sum would have to be known first, and 32 bits lose the
//! phase of far pixels).

use pipe_graph::prelude::*;
use pipe_graph::reference::border_index;

use crate::shader;

/// How pixels between pixels are computed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub(super) enum Kernel {
    /// Every pixel within the footprint alike; the nearest pixel when enlarging. Radius ½.
    Box,
    /// Triangle. Radius 1.
    Linear,
    /// Keys' cubic, a = −½ (Catmull-Rom): sharp, slight overshoot. Radius 2.
    Cubic,
    /// Mitchell & Netravali's cubic, B = C = ⅓: softer, hardly any overshoot. Radius 2.
    Mitchell,
    /// Windowed sinc of three lobes: sharpest, overshoots at hard edges. Radius 3.
    #[default]
    Lanczos3,
}

impl Kernel {
    /// Half the width, in pixels.
    pub(super) const fn radius(self) -> f64 {
        match self {
            Self::Box => 0.5,
            Self::Linear => 1.0,
            Self::Cubic | Self::Mitchell => 2.0,
            Self::Lanczos3 => 3.0,
        }
    }

    /// The kernel at distance x.
    pub(super) fn weight(self, x: f64) -> f64 {
        let a = x.abs();
        match self {
            // Half open: a pixel on the edge of two footprints belongs to one.
            Self::Box => f64::from(u8::from(-0.5 < x && x <= 0.5)),
            Self::Linear => (1.0 - a).max(0.0),
            Self::Cubic => cubic(a, 0.0, 0.5),
            Self::Mitchell => cubic(a, 1.0 / 3.0, 1.0 / 3.0),
            Self::Lanczos3 if a < 3.0 => sinc(a) * sinc(a / 3.0),
            Self::Lanczos3 => 0.0,
        }
    }
}

/// Mitchell & Netravali, Reconstruction Filters in Computer Graphics (1988), eq. 8.
fn cubic(x: f64, b: f64, c: f64) -> f64 {
    if x < 1.0 {
        ((12.0 - 9.0 * b - 6.0 * c) * x * x * x + (-18.0 + 12.0 * b + 6.0 * c) * x * x + (6.0 - 2.0 * b)) / 6.0
    } else if x < 2.0 {
        ((-b - 6.0 * c) * x * x * x + (6.0 * b + 30.0 * c) * x * x + (-12.0 * b - 48.0 * c) * x + (8.0 * b + 24.0 * c)) / 6.0
    } else {
        0.0
    }
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) }
}

/// One axis of a resampling: `output` pixels show `extent` input pixels from `start` on, out of `input`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    pub(super) input: u32,
    pub(super) output: u32,
    pub(super) start: f64,
    pub(super) extent: f64,
}

impl Axis {
    /// The whole input.
    pub(super) fn whole(input: u32, output: u32) -> Self {
        Self { input, output, start: 0.0, extent: f64::from(input) }
    }

    /// Whether output and input pixels are the same.
    pub(super) fn is_identity(&self) -> bool {
        *self == Self::whole(self.input, self.input)
    }

    /// Where output pixel `i` lies in the input.
    fn centre(&self, i: u32) -> f64 {
        self.start + (f64::from(i) + 0.5) * (self.extent / f64::from(self.output))
    }

    /// How much the kernel is stretched.
    fn stretch(&self) -> f64 {
        (self.extent / f64::from(self.output)).max(1.0)
    }

    /// The input pixels under the kernel of output pixel `i`, and their normalised weights.
    pub(super) fn footprint(&self, kernel: Kernel, i: u32) -> (i64, Vec<f64>) {
        let (centre, stretch) = (self.centre(i), self.stretch());
        let support = kernel.radius() * stretch;
        let first = (centre - support + 0.5).floor() as i64;
        let end = ((centre + support + 0.5).floor() as i64).max(first + 1);
        // In this order of operations, by which Pillow decides to which of two boxes a pixel on their edge belongs.
        let mut weights: Vec<f64> = (first..end).map(|x| kernel.weight((x as f64 - centre + 0.5) * (1.0 / stretch))).collect();
        let sum: f64 = weights.iter().sum();
        for w in &mut weights {
            *w /= sum;
        }
        (first, weights)
    }

    /// The table of weights for all output pixels.
    fn taps(&self, kernel: Kernel, border: Border) -> Taps {
        let common = gcd(self.input, self.output);
        let periodic = self.start == 0.0 && self.extent == f64::from(self.input);
        let (mut period, mut step) = if periodic { (self.output / common, self.input / common) } else { (self.output, 0) };
        let mut rows: Vec<_> = (0..period).map(|i| self.footprint(kernel, i)).collect();
        let mut width = rows.iter().map(|(_, w)| w.len()).max().unwrap_or(1);
        if width > self.input as usize {
            // The kernel is wider than the image: fold what lies outside back in, as the border policy says, so that
            // no pixel takes more steps than the image has columns.
            (period, step) = (self.output, 0);
            rows = (0..period).map(|i| (0, self.folded(kernel, i, border))).collect();
            width = self.input as usize;
        }
        let mut weights = Vec::with_capacity(rows.len() * width);
        for (_, row) in &rows {
            weights.extend(row.iter().map(|w| *w as f32));
            weights.resize(weights.len() + width - row.len(), 0.0);
        }
        let firsts = rows.iter().map(|(first, _)| *first as i32 as u32).collect();
        Taps { firsts, weights, width: width as i32, period: period as i32, step: step as i32 }
    }

    fn folded(&self, kernel: Kernel, i: u32, border: Border) -> Vec<f64> {
        let (first, weights) = self.footprint(kernel, i);
        let mut folded = vec![0.0; self.input as usize];
        for (x, w) in (first..).zip(weights) {
            if let Some(inside) = border_index(x, self.input, border) {
                folded[inside] += w;
            }
        }
        folded
    }
}

/// Weights of output pixel i: row i % period; its first input pixel: firsts\[i % period\] + i / period · step.
struct Taps {
    firsts: Vec<u32>,
    weights: Vec<f32>,
    width: i32,
    period: i32,
    step: i32,
}

impl Taps {
    /// Where output pixels look along an axis.
    fn stretch(&self, along: usize, axis: &Axis) -> Stretch {
        let straight = Stretch { along, num: (axis.extent.round() as i32).max(1), den: axis.output, first: 0, count: 1 };
        let off = || (0..).zip(&self.firsts).map(|(i, first)| i64::from(*first as i32) - straight.first_of(i));
        let (least, most) = (off().min().unwrap_or(0), off().max().unwrap_or(0));
        Stretch { first: least as i32, count: (most - least) as u32 + self.width as u32, ..straight }
    }
}

const fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Declares the passes that resample an image, one an axis; an axis that stays as it is costs none.
pub(super) fn lower(cx: &mut Lowering<'_>, image: ResourceId, kernel: Kernel, axes: [Axis; 2], out: Option<ResourceId>) -> ResourceId {
    let ty = cx.image_of(image);
    let work: Vec<usize> = in_best_order(kernel, &axes).into_iter().filter(|axis| !axes[*axis].is_identity()).collect();
    let mut current = image;
    let mut size = ty.size;
    for (i, axis) in work.iter().copied().enumerate() {
        size[axis] = axes[axis].output;
        let last = i + 1 == work.len();
        let target = match out {
            Some(out) if last => out,
            _ => cx.intermediate(["columns", "rows"][axis], Shape::image(size, ty.channels)),
        };
        let border = cx.border();
        let taps = axes[axis].taps(kernel, border);
        let firsts = cx.uints(["x_firsts", "y_firsts"][axis], &taps.firsts);
        let weights = cx.floats(["x_weights", "y_weights"][axis], &taps.weights);
        let mut looks = [0, 1].map(|along| Stretch::shift(along, 0));
        looks[axis] = taps.stretch(axis, &axes[axis]);
        let suffix = if work.len() == 1 && out.is_some() { "" } else { ["x", "y"][axis] };
        cx.pass(suffix, shader!("composite/resample"))
            .read("image", current, Reach::Elsewhere(looks))
            .read("firsts", firsts, Reach::Whole)
            .read("weights", weights, Reach::Whole)
            .write("out", target)
            .constant("AXIS", axis as i32)
            .param("width", taps.width)
            .param("period", taps.period)
            .param("step", taps.step)
            .add();
        current = target;
    }
    current
}

/// The axis first that leaves less to do for the other; y when both do, since neighbouring threads then read
/// neighbouring pixels of the large image.
fn in_best_order(kernel: Kernel, axes: &[Axis; 2]) -> [usize; 2] {
    let taps = |a: &Axis| 2.0 * kernel.radius() * a.stretch();
    let [x, y] = axes;
    let end = f64::from(x.output) * f64::from(y.output);
    let x_first = f64::from(x.output) * f64::from(y.input) * taps(x) + end * taps(y);
    let y_first = f64::from(x.input) * f64::from(y.output) * taps(y) + end * taps(x);
    if y_first <= x_first { [1, 0] } else { [0, 1] }
}

/// The twin: one axis after the other.
pub(super) fn reference(image: &Raster, kernel: Kernel, axes: [Axis; 2], border: Border) -> Raster {
    let [w, h] = [axes[0].output, axes[1].output];
    let along = |axis: Axis, kernel| -> Vec<(i64, Vec<f64>)> {
        (0..axis.output).map(|i| if axis.is_identity() { (i64::from(i), vec![1.0]) } else { axis.footprint(kernel, i) }).collect()
    };
    let (columns, rows) = (along(axes[0], kernel), along(axes[1], kernel));
    let weighted = |(first, weights): &(i64, Vec<f64>), load: &dyn Fn(i64) -> [f64; 4]| {
        let mut sum = [0.0; 4];
        for (i, weight) in (*first..).zip(weights) {
            let v = load(i);
            (0..4).for_each(|c| sum[c] += weight * v[c]);
        }
        sum
    };
    let wide = Raster::from_fn([w, image.size[1]], 4, |x, y| weighted(&columns[x as usize], &|i| image.load(i, y, border)));
    Raster::from_fn([w, h], image.channels, |x, y| weighted(&rows[y as usize], &|i| wide.load(x, i, border)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pillow 12, `Image.resize((m, 3), filter, box=(40, 0, 47, 3))` of the row below in mode F, its edges repeated
    /// 40 times to either side.
    #[test]
    fn agrees_with_pillow() {
        let row = [0.0, 1.0, 0.25, 2.0, 0.5, 0.125, 4.0];
        let image = Raster::from_fn([7, 1], 1, |x, _| [row[x as usize], 0.0, 0.0, 1.0]);
        let expected: [(Kernel, &[f64]); 12] = [
            (Kernel::Box, &[0.5, 0.916667, 2.0625]),
            (Kernel::Linear, &[0.421875, 1.066176, 1.890625]),
            (Kernel::Cubic, &[0.442416, 0.947591, 1.84691]),
            (Kernel::Lanczos3, &[0.505463, 0.848687, 1.836321]),
            (Kernel::Box, &[0.0, 0.625, 2.0, 0.3125, 4.0]),
            (Kernel::Linear, &[0.3, 0.583333, 1.409091, 0.333333, 2.8375]),
            (Kernel::Cubic, &[0.318229, 0.608854, 1.515073, 0.175521, 2.898698]),
            (Kernel::Lanczos3, &[0.344679, 0.628774, 1.559929, 0.060514, 2.906269]),
            (Kernel::Box, &[0.0, 0.0, 1.0, 0.25, 0.25, 2.0, 0.5, 0.5, 0.125, 4.0, 4.0]),
            (Kernel::Linear, &[0.0, 0.454545, 0.931818, 0.454545, 0.886364, 2.0, 1.045455, 0.397727, 0.159091, 2.238636, 4.0]),
            (Kernel::Cubic, &[-0.060856, 0.485537, 0.988167, 0.321563, 0.839031, 2.0, 1.099361, 0.201634, -0.00479, 2.261176, 4.235819]),
            (
                Kernel::Lanczos3,
                &[-0.104859, 0.560965, 0.964322, 0.25783, 0.846039, 2.0, 1.332304, -0.060152, -0.075221, 2.269588, 4.340168],
            ),
        ];
        for (kernel, expected) in expected {
            let axes = [Axis::whole(7, expected.len() as u32), Axis::whole(1, 1)];
            let got = reference(&image, kernel, axes, Border::Clamp);
            for (i, (g, e)) in got.pixels.iter().zip(expected).enumerate() {
                assert!((g[0] - e).abs() < 1e-5, "{kernel:?} to {}: pixel {i} is {}, expected {e}", expected.len(), g[0]);
            }
        }
    }

    #[test]
    fn tables_say_what_footprints_say() {
        for (input, output) in [(61, 30), (60, 20), (20, 60), (7, 11), (257, 1), (1, 9), (1, 1)] {
            for kernel in [Kernel::Box, Kernel::Linear, Kernel::Cubic, Kernel::Mitchell, Kernel::Lanczos3] {
                let axis = Axis::whole(input, output);
                let taps = axis.taps(kernel, Border::Clamp);
                assert!(taps.width <= input.max(7) as i32);
                for i in 0..output {
                    let (first, weights) = axis.footprint(kernel, i);
                    // Both as dense rows over the clamped input.
                    let (mut a, mut b) = (vec![0.0; input as usize], vec![0.0; input as usize]);
                    let put = |row: &mut Vec<f64>, x: i64, w: f64| row[x.clamp(0, i64::from(input) - 1) as usize] += w;
                    for (x, w) in (first..).zip(weights) {
                        put(&mut a, x, w);
                    }
                    let phase = i as i32 % taps.period;
                    let start = taps.firsts[phase as usize] as i32 + i as i32 / taps.period * taps.step;
                    for k in 0..taps.width {
                        put(&mut b, i64::from(start + k), f64::from(taps.weights[(phase * taps.width + k) as usize]));
                    }
                    for (x, (a, b)) in a.iter().zip(&b).enumerate() {
                        assert!((a - b).abs() < 1e-6, "{kernel:?} {input} to {output}: pixel {i}, column {x}");
                    }
                }
            }
        }
    }
}
