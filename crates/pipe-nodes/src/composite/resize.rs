//! `Resize`: an image at another size.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::pair::Pair;
use super::resampling::{self, Axis, Kernel};
use crate::shader;

/// Brings an image to another size. When it shrinks, the kernel widens with the ratio, so nothing aliases; weights sum
/// to 1. An axis that keeps its size is left untouched. Give `width` and `height`, one of them (the other follows), or
/// `scale`. `options.border` says what the kernel sees beyond the edges.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Resize {
    /// The image to resize.
    image: In<Image>,
    /// Columns of the result.
    #[schemars(range(min = 1, max = 65536), extend("x-unit" = "px"))]
    width: Option<u32>,
    /// Rows of the result.
    #[schemars(range(min = 1, max = 65536), extend("x-unit" = "px"))]
    height: Option<u32>,
    /// Size of the result over that of the image: a number, or `(x, y)`. Instead of `width` and `height`.
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1024.0))]
    scale: Option<Pair>,
    /// How pixels between pixels are computed.
    filter: Kernel,
    /// What happens when `width` and `height` have another shape than the image.
    fit: Fit,
}

/// What happens when the wanted size has another shape than the image.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Fit {
    /// The image is distorted.
    #[default]
    Stretch,
    /// The largest undistorted result within `width` × `height`: one of them gets smaller.
    Contain,
    /// As `Contain`, in the middle of `width` × `height` transparent black pixels.
    Letterbox,
    /// The middle of the image, undistorted, fills `width` × `height`; the rest is cut off.
    Cover,
}

pub(crate) const KIND: Kind = Kind::of::<Resize>(
    "Resize",
    Category::Composite,
    &[
        r#"Resize(image: "in", scale: 0.5)"#,
        r#"Resize(image: "in", width: 30, height: 20)"#,
        r#"Resize(image: "in", width: 30, height: 20, filter: Box)"#,
        r#"Resize(image: "in", width: 97, height: 71, filter: Linear)"#,
        r#"Resize(image: "in", scale: (1.5, 0.3), filter: Cubic)"#,
        r#"Resize(image: "grey", scale: 0.37, filter: Mitchell)"#,
        r#"Resize(image: "in", width: 3, filter: Lanczos3)"#,
        r#"Resize(image: "in", width: 1, height: 1, filter: Lanczos3)"#,
        r#"Resize(image: "in", height: 60, filter: Mitchell)"#,
        r#"Resize(image: "in", width: 40, height: 30, fit: Contain)"#,
        r#"Resize(image: "in", width: 40, height: 30, fit: Letterbox)"#,
        r#"Resize(image: "in", width: 40, height: 30, fit: Cover)"#,
        r#"Resize(image: "pair", scale: 2, filter: Linear)"#,
    ],
)
// Kernels with negative lobes subtract bright pixels from each other.
.tolerance(1e-5, 1e-5);

/// Where the resampled image goes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Placement {
    /// Size of the result.
    out: [u32; 2],
    /// How each axis is resampled.
    axes: [Axis; 2],
    /// Where the resampled image begins in the result.
    origin: [u32; 2],
}

/// A length scaled to whole pixels.
fn scaled(n: u32, factor: f64) -> u32 {
    (f64::from(n) * factor).round().clamp(1.0, 16_777_216.0) as u32
}

impl Resize {
    fn placement(&self, size: [u32; 2]) -> Result<Placement, Mistake> {
        let [w, h] = size.map(f64::from);
        let stretched = |out: [u32; 2]| Placement { out, axes: [0, 1].map(|i| Axis::whole(size[i], out[i])), origin: [0, 0] };
        let wanted = match (self.width, self.height, self.scale) {
            (None, None, None) => {
                return Err(Mistake::new("the new size is missing").hint("give `width` and `height`, one of them, or `scale`"));
            }
            (None, None, Some(scale)) => {
                let [sx, sy] = scale.xy();
                return Ok(stretched([scaled(size[0], sx), scaled(size[1], sy)]));
            }
            (_, _, Some(_)) => {
                return Err(Mistake::in_field("scale", "`scale` stands beside `width` or `height`").hint("give one or the other"));
            }
            (Some(width), None, None) => return Ok(stretched([width, scaled(size[1], f64::from(width) / w)])),
            (None, Some(height), None) => return Ok(stretched([scaled(size[0], f64::from(height) / h), height])),
            (Some(width), Some(height), None) => [width, height],
        };
        let ratio = [f64::from(wanted[0]) / w, f64::from(wanted[1]) / h];
        let inside = ratio[0].min(ratio[1]);
        let contained = [0, 1].map(|i| scaled(size[i], inside).min(wanted[i]));
        Ok(match self.fit {
            Fit::Stretch => stretched(wanted),
            Fit::Contain => stretched(contained),
            Fit::Letterbox => Placement { out: wanted, origin: [0, 1].map(|i| (wanted[i] - contained[i]) / 2), ..stretched(contained) },
            Fit::Cover => {
                let factor = ratio[0].max(ratio[1]);
                let axes = [0, 1].map(|i| {
                    let whole = Axis::whole(size[i], wanted[i]);
                    let extent = if ratio[i] == factor { whole.extent } else { f64::from(wanted[i]) / factor };
                    Axis { start: (whole.extent - extent) / 2.0, extent, ..whole }
                });
                Placement { out: wanted, axes, origin: [0, 0] }
            }
        })
    }
}

impl Node for Resize {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let image = inputs.image(&self.image);
        Ok(Output::out(EdgeType::Image(image.with_size(self.placement(image.size)?.out))))
    }

    fn makes_alpha(&self) -> bool {
        self.fit == Fit::Letterbox
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        let to = self.placement(cx.image_type(&self.image).size)?;
        if to.out != to.axes.map(|axis| axis.output) {
            let resized = resampling::lower(cx, image, self.filter, to.axes, None);
            let out = cx.output("out");
            let reach = Reach::shifted(to.origin.map(|n| -(n as i32)));
            cx.pass("frame", shader!("composite/pad"))
                .read_with("image", resized, reach, Border::Black, Filter::Nearest)
                .write("out", out)
                .constant("COLORED", true)
                .param("origin", to.origin.map(|n| n as i32))
                .param("color", [0.0_f32; 4])
                .add();
        } else if to.axes.iter().all(Axis::is_identity) {
            cx.emit("out", image);
        } else {
            let out = cx.output("out");
            resampling::lower(cx, image, self.filter, to.axes, Some(out));
        }
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let to = self.placement(image.size).expect("`outputs` has checked the size");
        let resized = resampling::reference(image, self.filter, to.axes, cx.border);
        let origin = to.origin.map(i64::from);
        let out = Raster::from_fn(to.out, image.channels, |x, y| {
            let (x, y) = (x - origin[0], y - origin[1]);
            let inside = (0..i64::from(resized.size[0])).contains(&x) && (0..i64::from(resized.size[1])).contains(&y);
            if inside { resized.at(x, y) } else { [0.0; 4] }
        });
        vec![Tensor::Image(out)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(resize: &Resize, size: [u32; 2]) -> Placement {
        resize.placement(size).expect("a size is given")
    }

    #[test]
    fn fits() {
        let to = |fit| Resize { width: Some(40), height: Some(40), fit, ..Resize::default() };
        assert_eq!(placed(&to(Fit::Stretch), [80, 20]).out, [40, 40]);
        assert_eq!(placed(&to(Fit::Contain), [80, 20]).out, [40, 10]);
        let boxed = placed(&to(Fit::Letterbox), [80, 20]);
        assert_eq!((boxed.out, boxed.axes.map(|a| a.output), boxed.origin), ([40, 40], [40, 10], [0, 15]));
        let cover = placed(&to(Fit::Cover), [80, 20]);
        assert_eq!((cover.axes[0].start, cover.axes[0].extent), (30.0, 20.0));
        assert_eq!((cover.axes[1].start, cover.axes[1].extent), (0.0, 20.0));
    }

    #[test]
    fn one_side_follows_the_other() {
        assert_eq!(placed(&Resize { width: Some(30), ..Resize::default() }, [60, 41]).out, [30, 21]);
        assert_eq!(placed(&Resize { height: Some(1), ..Resize::default() }, [1, 400]).out, [1, 1]);
        assert_eq!(placed(&Resize { scale: Some(Pair::Each(0.001, 2.0)), ..Resize::default() }, [60, 41]).out, [1, 82]);
        assert!(Resize::default().placement([60, 41]).is_err());
    }
}
