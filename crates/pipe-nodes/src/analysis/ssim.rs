//! Structural similarity (Wang, Bovik, Sheikh and Simoncelli, Image Quality Assessment, 2004).
//!
//! Of the luminances, in a Gaussian window of 11 taps and σ = 1.5: means, variances and covariance, without the
//! correction for samples. Where the window leaves the image, the border policy says what is there, and every pixel
//! counts in the mean, as in MATLAB; scikit-image leaves the five outermost pixels out.

use pipe_graph::prelude::*;

use super::reduction::grey;
use crate::shader;

/// Taps to either side.
const RADIUS: u32 = 5;

/// 1 − similarity of two images.
pub(crate) fn lower(cx: &mut Lowering<'_>, a: ResourceId, b: ResourceId, out: ResourceId, peak: f32) {
    let size = cx.image_of(out).size;
    let weights = cx.floats("weights", &weights().map(|w| w as f32));
    let luminances = cx.intermediate("luminances", Shape::image(size, 2));
    cx.pass("luminances", shader!("analysis/ssim_luminance"))
        .entry(Entry::Point)
        .read("a", a, Reach::Point)
        .read("b", b, Reach::Point)
        .write("out", luminances)
        .add();
    let moments = cx.intermediate("moments", Shape::image(size, 4));
    let products = cx.intermediate("products", Shape::image(size, 1));
    cx.pass("rows", shader!("analysis/ssim_rows"))
        .entry(Entry::Each)
        .read("luminances", luminances, Reach::Around(RADIUS, 0))
        .read("weights", weights, Reach::Whole)
        .write("moments", moments)
        .write("products", products)
        .constant("RADIUS", RADIUS as i32)
        .add();
    cx.pass("difference", shader!("analysis/ssim"))
        .entry(Entry::At)
        .read("moments", moments, Reach::Around(0, RADIUS))
        .read("products", products, Reach::Around(0, RADIUS))
        .read("weights", weights, Reach::Whole)
        .write("out", out)
        .constant("RADIUS", RADIUS as i32)
        .param("c1", (0.01 * peak).powi(2))
        .param("c2", (0.03 * peak).powi(2))
        .add();
}

/// The twin.
pub(crate) fn reference(a: &Raster, b: &Raster, border: Border, peak: f64) -> Raster {
    let weights = weights();
    let radius = i64::from(RADIUS);
    let (c1, c2) = ((0.01 * peak).powi(2), (0.03 * peak).powi(2));
    Raster::from_fn(a.size, 1, |x, y| {
        let window = || {
            (-radius..=radius).flat_map(move |j| (-radius..=radius).map(move |i| (i, j))).map(|(i, j)| {
                let weight = weights[(i + radius) as usize] * weights[(j + radius) as usize];
                (weight, grey(a.load(x + i, y + j, border)), grey(b.load(x + i, y + j, border)))
            })
        };
        let mean = |f: &dyn Fn(f64, f64) -> f64| window().map(|(w, p, q)| w * f(p, q)).sum::<f64>();
        let (ma, mb) = (mean(&|p, _| p), mean(&|_, q| q));
        let va = mean(&|p, _| (p - ma).powi(2));
        let vb = mean(&|_, q| (q - mb).powi(2));
        let cov = mean(&|p, q| (p - ma) * (q - mb));
        let similarity = (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
        [1.0 - similarity; 4]
    })
}

/// exp(−k²/2σ²), σ = 1.5, normalised.
fn weights() -> [f64; 11] {
    let raw: [f64; 11] = std::array::from_fn(|i| (-(i as f64 - 5.0).powi(2) / (2.0 * 1.5 * 1.5)).exp());
    let sum: f64 = raw.iter().sum();
    raw.map(|w| w / sum)
}

#[cfg(test)]
mod tests {
    use super::super::flip::tests::picture;
    use super::*;

    #[test]
    fn agrees_with_scikit_image_away_from_the_border() {
        // skimage.metrics.structural_similarity(a, b, gaussian_weights=True, sigma=1.5,
        // use_sample_covariance=False, data_range=1, full=True) of the red channels (scikit-image 0.26).
        let [a, b] = [picture(1), picture(4)].map(|p| p.map(1, |c| [c[0]; 4]));
        let map = reference(&a, &b, Border::Clamp, 1.0);
        for (x, y, expected) in [(5, 5, 0.134_556_304_797_755_2), (10, 6, 0.180_077_524_842_624_18)] {
            assert!((1.0 - map.at(x, y)[0] - expected).abs() < 1e-12);
        }
    }
}
