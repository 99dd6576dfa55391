//! `Transform`: moves, turns and scales an image within its frame.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::pair::Pair;
use super::resampling::{self, Axis, Kernel};
use crate::shader;

/// Scales an image about `center`, turns it about `center`, then moves it. The frame keeps its size;
/// `options.border` says what comes in from outside (`Black`: transparent). Where the image shrinks it is first
/// resized with the same filter, so nothing aliases.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Transform {
    /// The image to place.
    image: In<Image>,
    /// To the right and downwards; fractions of a pixel count.
    #[schemars(range(min = -1e6, max = 1e6), extend("x-unit" = "px"))]
    translate: [f32; 2],
    /// Angle, clockwise.
    #[schemars(extend("x-unit" = "°"))]
    rotate: f32,
    /// Factor, or `(x, y)`: above 1 enlarges.
    #[default(Pair::Both(1.0))]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1024.0))]
    scale: Pair,
    /// The point that scaling and turning leave in place, from the upper left corner; absent: the middle of the image.
    #[schemars(range(min = -1e6, max = 1e6), extend("x-unit" = "px"))]
    center: Option<[f32; 2]>,
    /// How pixels between pixels are computed.
    filter: Filtering,
}

/// How pixels between pixels are computed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Filtering {
    /// The pixel that holds the point; shrinking aliases.
    Nearest,
    /// As `Nearest`, shrinking averages.
    Box,
    /// Triangle, radius 1.
    Linear,
    /// Keys' cubic, a = −½ (Catmull-Rom).
    #[default]
    Cubic,
    /// Mitchell & Netravali's cubic, B = C = ⅓: softer.
    Mitchell,
    /// Windowed sinc of three lobes.
    Lanczos3,
}

pub(crate) const KIND: Kind = Kind::of::<Transform>(
    "Transform",
    Category::Composite,
    &[
        r#"Transform(image: "in", translate: [3.25, -1.5])"#,
        r#"Transform(image: "in", rotate: 30)"#,
        r#"Transform(image: "in", rotate: -12.5, scale: 1.7, filter: Linear)"#,
        r#"Transform(image: "in", rotate: 45, scale: 0.4, filter: Lanczos3)"#,
        r#"Transform(image: "in", scale: (0.5, 2), center: [0, 0], filter: Mitchell)"#,
        r#"Transform(image: "grey", rotate: 90, filter: Nearest)"#,
        r#"Transform(image: "in", scale: (3, 0.3), filter: Nearest)"#,
        r#"Transform(image: "in", scale: 0.3, rotate: 180, filter: Box)"#,
        r#"Transform(image: "pair", translate: [1000, 0], rotate: 10, filter: Cubic)"#,
    ],
)
// Kernels with negative lobes subtract bright pixels from each other.
.tolerance(1e-5, 2e-5);

impl Filtering {
    const fn kernel(self) -> Kernel {
        match self {
            Self::Nearest | Self::Box => Kernel::Box,
            Self::Linear => Kernel::Linear,
            Self::Cubic => Kernel::Cubic,
            Self::Mitchell => Kernel::Mitchell,
            Self::Lanczos3 => Kernel::Lanczos3,
        }
    }
}

/// x′ = a·x + b·y + c along both axes: from the frame to the (resized) image.
type Affine = [[f64; 3]; 2];

/// Sine and cosine of an angle in degrees, exact at quarter turns.
fn sin_cos(degrees: f64) -> (f64, f64) {
    match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        turned => turned.to_radians().sin_cos(),
    }
}

impl Transform {
    /// How the image is resized before it is placed.
    fn axes(&self, size: [u32; 2]) -> [Axis; 2] {
        let scale = self.scale.xy();
        [0, 1].map(|i| {
            let shrunk = (f64::from(size[i]) * scale[i]).round().max(1.0) as u32;
            Axis::whole(size[i], if scale[i] < 1.0 && self.filter != Filtering::Nearest { shrunk } else { size[i] })
        })
    }

    /// From a point of the frame to a point of the resized image.
    fn backward(&self, size: [u32; 2], axes: [Axis; 2]) -> Affine {
        let center = self.center.map_or_else(|| size.map(|n| f64::from(n) / 2.0), |c| c.map(f64::from));
        let pivot = [0, 1].map(|i| center[i] + f64::from(self.translate[i]));
        let (sin, cos) = sin_cos(f64::from(self.rotate));
        let turn_back = [[cos, sin], [-sin, cos]];
        let scale = self.scale.xy();
        [0, 1].map(|i| {
            let resized = f64::from(axes[i].output) / f64::from(axes[i].input);
            let [a, b] = turn_back[i].map(|v| v / scale[i] * resized);
            [a, b, center[i] * resized - a * pivot[0] - b * pivot[1]]
        })
    }
}

/// A number as two floats.
fn wide(v: f64) -> [f32; 2] {
    let high = v as f32;
    [high, (v - f64::from(high)) as f32]
}

impl Node for Transform {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let size = cx.image_type(&self.image).size;
        let (axes, kernel) = (self.axes(size), self.filter.kernel());
        let image = cx.input(&self.image);
        let image = resampling::lower(cx, image, kernel, axes, None);
        let out = cx.output("out");
        let [x, y] = self.backward(size, axes);
        let mut pass = cx
            .pass("", shader!("composite/transform"))
            .read("image", image, Reach::Whole)
            .write("out", out)
            .constant("KERNEL", kernel as i32)
            .constant("RADIUS", kernel.radius().ceil() as i32);
        for (name, value) in ["xx", "xy", "x0", "yx", "yy", "y0"].into_iter().zip(x.into_iter().chain(y)) {
            pass = pass.param(name, wide(value));
        }
        pass.add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let whole = cx.image(&self.image);
        let (axes, kernel) = (self.axes(whole.size), self.filter.kernel());
        let image = resampling::reference(whole, kernel, axes, cx.border);
        let backward = self.backward(whole.size, axes);
        let out = Raster::from_fn(whole.size, whole.channels, |x, y| {
            let [u, v] = backward.map(|[a, b, c]| a * (x as f64 + 0.5) + b * (y as f64 + 0.5) + c);
            if kernel == Kernel::Box {
                return image.load(u.floor() as i64, v.floor() as i64, cx.border);
            }
            let radius = kernel.radius() as i64;
            let (i, j) = ((u - 0.5).floor() as i64, (v - 0.5).floor() as i64);
            let (mut sum, mut weights) = ([0.0; 4], 0.0);
            for q in j - radius + 1..=j + radius {
                for p in i - radius + 1..=i + radius {
                    let w = kernel.weight(p as f64 + 0.5 - u) * kernel.weight(q as f64 + 0.5 - v);
                    let pixel = image.load(p, q, cx.border);
                    (0..4).for_each(|c| sum[c] += w * pixel[c]);
                    weights += w;
                }
            }
            sum.map(|s| s / weights)
        });
        vec![Tensor::Image(out)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apply(m: Affine, [x, y]: [f64; 2]) -> [f64; 2] {
        m.map(|[a, b, c]| a * x + b * y + c)
    }

    #[test]
    fn a_quarter_turn_is_clockwise() {
        let turn = Transform { rotate: 90.0, ..Transform::default() };
        let m = turn.backward([8, 8], turn.axes([8, 8]));
        // What stands at the right edge came from the top.
        assert_eq!(apply(m, [8.0, 4.0]), [4.0, 0.0]);
    }

    #[test]
    fn shrinking_goes_through_a_resized_image() {
        let shrink = Transform { scale: Pair::Both(0.5), translate: [2.0, 0.0], center: Some([0.0, 0.0]), ..Transform::default() };
        let axes = shrink.axes([8, 8]);
        assert_eq!(axes.map(|a| a.output), [4, 4]);
        // The resized image lies at (2, 0) pixel for pixel.
        assert_eq!(shrink.backward([8, 8], axes), [[1.0, 0.0, -2.0], [0.0, 1.0, 0.0]]);
    }

    /// Pillow 12 on the image below, its edges repeated 20 times to every side: `rotate(-30, BILINEAR)`, and
    /// `transform(AFFINE, …, BILINEAR)` of the inverse map.
    #[test]
    fn agrees_with_pillow() {
        let image = Raster::from_fn([9, 9], 1, |x, y| [((3 * x * x + 5 * y * x + 7 * y) % 13) as f64 / 13.0, 0.0, 0.0, 1.0]);
        let input = Tensor::Image(image);
        let turn = Transform { rotate: 30.0, ..Transform::default() };
        let grow = Transform { scale: Pair::Both(1.5), translate: [2.25, -0.5], ..Transform::default() };
        for (node, expected) in
            [(turn, [0.365484, 0.0, 0.596253, 0.553722, 0.723423]), (grow, [0.230769, 0.5, 0.773504, 0.508547, 0.444444])]
        {
            let node = Transform { image: In::new(pipe_graph::field::EdgeIndex(0)), filter: Filtering::Linear, ..node };
            let cx = Reference { inputs: &[&input], file: None, border: Border::Clamp, filter: Filter::Linear, seed: 0 };
            let Tensor::Image(got) = &node.reference(&cx)[0] else { panic!("the result is an image") };
            for ((x, y), expected) in [(0, 0), (4, 4), (2, 6), (8, 3), (5, 1)].into_iter().zip(expected) {
                assert!((got.at(x, y)[0] - expected).abs() < 2e-6, "({x}, {y}) is {}, expected {expected}", got.at(x, y)[0]);
            }
        }
    }
}
