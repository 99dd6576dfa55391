//! LDR-FLIP, the difference that an observer perceives when two images alternate (Andersson, Nilsson,
//! Akenine-Möller, Oskarsson, Åström and Fairchild, FLIP: A Difference Evaluator for Alternating Images, 2020).
//!
//! Colours are blurred as the eye does (contrast sensitivity in an opponent space), compared in Hunt-adjusted CIELAB
//! by the HyAB distance, and the difference is raised where edges or points differ. All filters are separable: a
//! pass along rows makes the four means of the opponent colours (two for the blue–yellow one, whose sensitivity is a
//! sum of two Gaussians) and three of the achromatic one, a pass along columns all the rest. Outside the image its
//! edge pixels continue, whatever the border policy.

use std::f64::consts::PI;

use pipe_graph::prelude::*;

use crate::shader;

/// The perceived difference of two linear images, 0..1.
pub(crate) fn lower(cx: &mut Lowering<'_>, a: ResourceId, b: ResourceId, out: ResourceId, pixels_per_degree: f32) {
    let size = cx.image_of(out).size;
    let taps = Taps::new(f64::from(pixels_per_degree));
    let radius = taps.radius;
    let all: Vec<f32> = taps.all().into_iter().flatten().map(|w| *w as f32).collect();
    let weights = cx.floats("weights", &all);
    let mut rows = Vec::new();
    for (name, image) in [("a", a), ("b", b)] {
        let opponent = cx.intermediate(&format!("{name}.opponent"), Shape::image(size, 4));
        cx.pass(&format!("{name}.opponent"), shader!("analysis/flip_opponent"))
            .entry(Entry::Point)
            .read("image", image, Reach::Point)
            .write("out", opponent)
            .add();
        let colours = cx.intermediate(&format!("{name}.colours"), Shape::image(size, 4));
        let features = cx.intermediate(&format!("{name}.features"), Shape::image(size, 4));
        cx.pass(&format!("{name}.rows"), shader!("analysis/flip_rows"))
            .entry(Entry::Each)
            .read_with("opponent", opponent, Reach::Around(radius, 0), Border::Clamp, Filter::Nearest)
            .read("weights", weights, Reach::Whole)
            .write("colours", colours)
            .write("features", features)
            .constant("RADIUS", radius as i32)
            .add();
        rows.extend([colours, features]);
    }
    let mut pass = cx.pass("difference", shader!("analysis/flip")).entry(Entry::At);
    for (port, id) in ["colours_a", "features_a", "colours_b", "features_b"].into_iter().zip(rows) {
        pass = pass.read_with(port, id, Reach::Around(0, radius), Border::Clamp, Filter::Nearest);
    }
    pass.read("weights", weights, Reach::Whole)
        .write("out", out)
        .constant("RADIUS", radius as i32)
        .param("most", most_difference() as f32)
        .add();
}

/// Weights along one axis, −radius..radius each.
struct Taps {
    radius: u32,
    achromatic: Vec<f64>,
    red_green: Vec<f64>,
    blue_yellow: [Vec<f64>; 2],
    smooth: Vec<f64>,
    edge: Vec<f64>,
    point: Vec<f64>,
}

/// Contrast sensitivity (table 1 of the paper): a·√(π/b)·exp(−π²x²/b) of the two Gaussians of blue–yellow.
const BLUE_YELLOW: [(f64, f64); 2] = [(34.1, 0.04), (13.5, 0.025)];
const ACHROMATIC: f64 = 0.0047;
const RED_GREEN: f64 = 0.0053;

/// Width of a perceived feature, in degrees.
const FEATURE: f64 = 0.082;

impl Taps {
    fn new(pixels_per_degree: f64) -> Self {
        let deviation = 0.5 * FEATURE * pixels_per_degree;
        let colour_radius = (3.0 * (BLUE_YELLOW[0].1 / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
        let feature_radius = (3.0 * deviation).ceil() as i32;
        let radius = colour_radius.max(feature_radius);
        // Each filter has its own radius; beyond it its weights are 0.
        let taps = |own: i32, f: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (-radius..=radius).map(|x| if x.abs() <= own { f(f64::from(x)) } else { 0.0 }).collect()
        };
        let sensitivity = |b: f64| taps(colour_radius, &|x| (-PI * PI * (x / pixels_per_degree).powi(2) / b).exp());
        let sum = |w: &[f64]| w.iter().sum::<f64>();
        let unit = |w: Vec<f64>| {
            let s = sum(&w);
            w.into_iter().map(|v| v / s).collect::<Vec<_>>()
        };
        let gaussians = BLUE_YELLOW.map(|(_, b)| sensitivity(b));
        let factors = BLUE_YELLOW.map(|(a, b)| a * (PI / b).sqrt());
        let whole: f64 = gaussians.iter().zip(factors).map(|(g, k)| k * sum(g).powi(2)).sum();
        let mut blue_yellow = gaussians;
        for (taps, k) in blue_yellow.iter_mut().zip(factors) {
            taps.iter_mut().for_each(|w| *w *= (k / whole).sqrt());
        }
        let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
        // Positive weights sum to 1, negative ones to −1.
        let balanced = |w: Vec<f64>| {
            let up: f64 = w.iter().filter(|v| **v > 0.0).sum();
            let down: f64 = -w.iter().filter(|v| **v < 0.0).sum::<f64>();
            w.into_iter().map(|v| if v < 0.0 { v / down } else { v / up }).collect::<Vec<_>>()
        };
        Self {
            radius: radius as u32,
            achromatic: unit(sensitivity(ACHROMATIC)),
            red_green: unit(sensitivity(RED_GREEN)),
            blue_yellow,
            smooth: unit(taps(feature_radius, &gaussian)),
            edge: balanced(taps(feature_radius, &|x| -x * gaussian(x))),
            point: balanced(taps(feature_radius, &|x| ((x / deviation).powi(2) - 1.0) * gaussian(x))),
        }
    }

    /// As the shaders have them: one after another.
    fn all(&self) -> [&Vec<f64>; 7] {
        let [first, second] = &self.blue_yellow;
        [&self.achromatic, &self.red_green, first, second, &self.smooth, &self.edge, &self.point]
    }
}

/// Linear sRGB → XYZ relative to its white, so that white is (1, 1, 1).
fn relative_xyz([r, g, b]: [f64; 3]) -> [f64; 3] {
    let row = |m: [f64; 3]| (m[0] * r + m[1] * g + m[2] * b) / (m[0] + m[1] + m[2]);
    XYZ.map(row)
}

/// The matrix of the reference implementation, scaled to integers.
const XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// CIELAB with Hunt's adjustment: chroma shrinks with lightness.
fn hunt_lab(linear: [f64; 3]) -> [f64; 3] {
    let f = |t: f64| {
        let d: f64 = 6.0 / 29.0;
        if t > d.powi(3) { t.cbrt() } else { t / (3.0 * d * d) + 4.0 / 29.0 }
    };
    let [x, y, z] = relative_xyz(linear).map(f);
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// HyAB: city block in lightness, Euclidean in chroma.
fn hyab(p: [f64; 3], q: [f64; 3]) -> f64 {
    (p[0] - q[0]).abs() + (p[1] - q[1]).hypot(p[2] - q[2])
}

/// The largest colour difference, between green and blue, raised to 0.7.
fn most_difference() -> f64 {
    hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(0.7)
}

/// The twin, with filters of two dimensions.
pub(crate) fn reference(a: &Raster, b: &Raster, pixels_per_degree: f64) -> Raster {
    let taps = Taps::new(pixels_per_degree);
    let most = most_difference();
    let seen = [a, b].map(|image| Seen::new(image, &taps));
    Raster::from_fn(a.size, 1, |x, y| {
        let [p, q] = [&seen[0], &seen[1]].map(|s| (hunt_lab(s.colour(x, y)), s.feature(x, y, &taps.edge), s.feature(x, y, &taps.point)));
        let raised = hyab(p.0, q.0).powf(0.7);
        let knee = 0.4 * most;
        let colour = if raised < knee { 0.95 / knee * raised } else { 0.95 + (raised - knee) / (most - knee) * 0.05 };
        let feature = ((p.1 - q.1).abs().max((p.2 - q.2).abs()) / 2.0_f64.sqrt()).sqrt();
        [colour.powf(1.0 - feature); 4]
    })
}

/// One image as the twin sees it.
struct Seen<'a> {
    opponent: Raster,
    taps: &'a Taps,
}

impl<'a> Seen<'a> {
    fn new(image: &Raster, taps: &'a Taps) -> Self {
        // Achromatic, red–green, blue–yellow: linear relatives of L*, a*, b*.
        let opponent = image.map(4, |[r, g, b, _]| {
            let [x, y, z] = relative_xyz([r, g, b].map(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) }));
            [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z), 1.0]
        });
        Self { opponent, taps }
    }

    fn filtered(&self, x: i64, y: i64, channel: usize, weight: &dyn Fn(usize, usize) -> f64) -> f64 {
        let radius = i64::from(self.taps.radius);
        let mut sum = 0.0;
        for j in 0..=2 * radius {
            for i in 0..=2 * radius {
                let w = weight(i as usize, j as usize);
                if w != 0.0 {
                    sum += w * self.opponent.load(x + i - radius, y + j - radius, Border::Clamp)[channel];
                }
            }
        }
        sum
    }

    /// What the eye sees of the colour, as linear sRGB within 0..1.
    fn colour(&self, x: i64, y: i64) -> [f64; 3] {
        let Taps { achromatic, red_green, blue_yellow: [by1, by2], .. } = self.taps;
        let a = self.filtered(x, y, 0, &|i, j| achromatic[i] * achromatic[j]);
        let rg = self.filtered(x, y, 1, &|i, j| red_green[i] * red_green[j]);
        let by = self.filtered(x, y, 2, &|i, j| by1[i] * by1[j] + by2[i] * by2[j]);
        let luminance = (a + 16.0) / 116.0;
        let xyz = [luminance + rg / 500.0, luminance, luminance - by / 200.0];
        let absolute = [0, 1, 2].map(|i| xyz[i] * XYZ[i].iter().sum::<f64>());
        let inverse = glam::DMat3::from_cols_array_2d(&XYZ).transpose().inverse();
        (inverse * glam::DVec3::from(absolute)).clamp(glam::DVec3::ZERO, glam::DVec3::ONE).to_array()
    }

    /// How much of an edge or a point there is.
    fn feature(&self, x: i64, y: i64, across: &[f64]) -> f64 {
        let smooth = &self.taps.smooth;
        let along_x = self.filtered(x, y, 0, &|i, j| across[i] * smooth[j]);
        let along_y = self.filtered(x, y, 0, &|i, j| smooth[i] * across[j]);
        // Of (L* + 16)/116; the weights sum to 0, so the constant does not matter.
        along_x.hypot(along_y) / 116.0
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A small picture that is easily written elsewhere.
    pub(in super::super) fn picture(k: i64) -> Raster {
        Raster::from_fn([16, 12], 4, |x, y| {
            let part = |v: i64, n: i64| (v % n) as f64 / (n - 1) as f64;
            [part(x * 7 + y * 13 + k, 17), part(x * 3 + y * 5 + 2 * k, 11), part(x * x + y * k, 7), 1.0]
        })
    }

    #[test]
    fn agrees_with_the_reference_implementation() {
        // flip_evaluator.evaluate(a, b, "LDR", inputsRGB=False) of NVIDIA's flip-evaluator 1.7, 32-bit.
        let map = reference(&picture(1), &picture(4), 67.0206);
        let mean = map.pixels.iter().map(|p| p[0]).sum::<f64>() / map.pixels.len() as f64;
        for (found, expected) in
            [(mean, 0.256_670_8), (map.at(0, 0)[0], 0.537_007_5), (map.at(7, 5)[0], 0.139_702_4), (map.at(15, 11)[0], 0.823_598)]
        {
            assert!((found - expected).abs() < 5e-6, "{found}, expected {expected}");
        }
    }
}
