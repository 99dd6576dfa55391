//! `PyramidAverage`: the mean of an image, and the chain of halved images that leads to it.
//!
//! The mean itself comes from a reduction in two dispatches ([`reduction`](super::reduction)), which is what a
//! chain down to one pixel computes, without its dozen dispatches. The chain is only made when its port is used.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::reduction::{self, Mean, View, finite_values, view};
use crate::shader;

/// The mean of every channel, alpha included, exact for every size. Values that are NaN or infinite take no part.
///
/// `pyramid` shows the chain that halves the image until one pixel is left, as one image. Level 0, at the top
/// left, has the size of the image; every next level has half the width and height, rounded up. Level 1 stands
/// to the right of level 0, each further one below the one before it; the rest is 0. So the picture is
/// w + ⌈w/2⌉ wide, and its height is h or what the levels from 1 on need. A pixel of level k is the mean of the
/// 2ᵏ×2ᵏ pixels that it covers, of as many as there are at the right and the bottom, so the last level is the
/// mean of the image. Level 0 is the image itself (ε + max(v, 0) of it for the geometric mean).
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct PyramidAverage {
    /// The image to average.
    image: In<Image>,
    /// `Arithmetic`: Σv/n. `Geometric`: exp(Σ log(ε + max(v, 0))/n), the log-average luminance of tone mapping.
    mean: Mean,
    /// ε of the geometric mean: keeps the logarithm of black finite.
    #[default(1e-6)]
    #[schemars(range(min = 1e-30, max = 1e30))]
    epsilon: f32,
}

pub(crate) const KIND: Kind = Kind::of::<PyramidAverage>(
    "PyramidAverage",
    Category::Analysis,
    &[
        r#"PyramidAverage(image: "in")"#,
        r#"PyramidAverage(image: "grey", mean: Geometric)"#,
        r#"PyramidAverage(image: "in", mean: Geometric, epsilon: 0.01)"#,
        r#"PyramidAverage(image: "pair")"#,
    ],
)
.ports(&[("out", "the mean of every channel, a Scalar"), ("pyramid", "all levels of the chain as one image")]);

impl Node for PyramidAverage {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let image = inputs.image(&self.image);
        let pyramid = image.with_size(Atlas::of(image.size).size);
        let out = ScalarType { components: image.channels };
        Ok(vec![Output::new("out", EdgeType::Scalar(out)), Output::new("pyramid", EdgeType::Image(pyramid))])
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        let mean = reduction::mean(cx, "mean", image, self.mean, self.epsilon, false);
        cx.emit("out", mean);
        self.lower_pyramid(cx, image);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let pixels = view(image, View::Channels);
        let channels = usize::from(image.channels);
        let mean = |c: usize| reduction::mean_reference(&finite_values(&pixels, c), self.mean, f64::from(self.epsilon));
        vec![Tensor::Scalar((0..channels).map(mean).collect()), Tensor::Image(self.reference_pyramid(image))]
    }
}

impl PyramidAverage {
    /// Level after level; each pass leaves its level alone, for the next one, and in the common picture.
    fn lower_pyramid(&self, cx: &mut Lowering<'_>, image: ResourceId) {
        let ty = cx.image_of(image);
        let atlas = Atlas::of(ty.size);
        let geometric = self.mean == Mean::Geometric;
        let name = |level: usize| format!("level{level}");
        let out = cx.output("pyramid");
        // The levels are written into the same storage one after the other, so all have the precision that is asked for.
        let pyramid = cx.shape(out);
        let mut picture = if atlas.levels.len() == 1 { out } else { cx.intermediate("level0", pyramid) };
        cx.pass("level0", shader!("analysis/pyramid_base"))
            .entry(Entry::At)
            .read("image", image, Reach::Whole)
            .write("out", picture)
            .constant("GEOMETRIC", geometric)
            .param("epsilon", self.epsilon)
            .add();
        // The first level finds out by itself which values are finite; it is given the image in place of counts.
        let (mut finer, mut counts) = (image, image);
        for (k, level) in atlas.levels.iter().enumerate().skip(1) {
            let mut coarser = |what: &str| cx.intermediate(&format!("{}.{what}", name(k)), Shape::image(level.size, ty.channels));
            let (values, weights) = (coarser("values"), coarser("counts"));
            let last = k + 1 == atlas.levels.len();
            let next = if last { out } else { cx.intermediate(&name(k), pyramid) };
            cx.pass(&name(k), shader!("analysis/pyramid_level"))
                .entry(Entry::Each)
                .read("finer", finer, Reach::Whole)
                .read("counts", counts, Reach::Whole)
                .write("coarser", values)
                .write("coarser_counts", weights)
                .write_as("picture", next, Access::Store, Some(picture))
                .constant("GEOMETRIC", geometric)
                .constant("FIRST", k == 1)
                .param("epsilon", self.epsilon)
                .param("origin", level.origin.map(|v| v as i32))
                .add();
            (finer, counts, picture) = (values, weights, next);
        }
    }

    fn reference_pyramid(&self, image: &Raster) -> Raster {
        let atlas = Atlas::of(image.size);
        let mut picture = Raster::from_fn(atlas.size, image.channels, |_, _| [0.0; 4]);
        for (k, level) in atlas.levels.iter().enumerate() {
            for y in 0..level.size[1] {
                for x in 0..level.size[0] {
                    let covered = |i: u32, n: u32| (i << k)..((i + 1) << k).min(n);
                    let mut pixels = Vec::new();
                    for sy in covered(y, image.size[1]) {
                        for sx in covered(x, image.size[0]) {
                            pixels.push(image.at(i64::from(sx), i64::from(sy)));
                        }
                    }
                    let epsilon = f64::from(self.epsilon);
                    let of = |c: usize| reduction::mean_reference(&finite_values(&pixels, c), self.mean, epsilon);
                    let at = (level.origin[1] + y) as usize * atlas.size[0] as usize + (level.origin[0] + x) as usize;
                    picture.pixels[at] = narrow(std::array::from_fn(of), image.channels);
                }
            }
        }
        picture
    }
}

/// Where every level stands in the common picture.
#[derive(Debug, Clone, PartialEq)]
struct Atlas {
    size: [u32; 2],
    levels: Vec<Level>,
}

/// One level.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Level {
    origin: [u32; 2],
    size: [u32; 2],
}

impl Atlas {
    fn of(size: [u32; 2]) -> Self {
        let mut level = Level { origin: [0, 0], size };
        let mut levels = vec![level];
        let mut below = 0;
        while level.size != [1, 1] {
            level = Level { origin: [size[0], below], size: level.size.map(|n| n.div_ceil(2)) };
            below += level.size[1];
            levels.push(level);
        }
        let width = size[0] + levels.get(1).map_or(0, |l| l.size[0]);
        Self { size: [width, size[1].max(below)], levels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_stand_beside_the_image_without_touching() {
        let atlas = Atlas::of([5, 3]);
        assert_eq!(atlas.size, [8, 4]);
        let places: Vec<_> = atlas.levels.iter().map(|l| (l.origin, l.size)).collect();
        assert_eq!(places, [([0, 0], [5, 3]), ([5, 0], [3, 2]), ([5, 2], [2, 1]), ([5, 3], [1, 1])]);
        assert_eq!(Atlas::of([1, 1]).size, [1, 1]);
    }
}
