//! `SampleImage`: a texture sampler as a node.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// Looks an image or a volume up at coordinates, as a shader looks up a texture: out(x, y) = image(coords(x, y)). The
/// result has the size of `coords` and the channels of `image`. Weights are 32-bit, not the 8 bits of texture units.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct SampleImage {
    /// What is looked up: an image or a volume.
    image: In<ImageOrVolume>,
    /// Where: red from the left edge, green from the top edge (of a volume: along x, y, and blue along z).
    coords: In<Image>,
    /// What lies beyond the edges.
    address: Address,
    /// Between pixel centres.
    #[default(Sampling::Linear)]
    filter: Sampling,
    /// Whether 1 stands for the whole extent; otherwise coordinates count pixels, whose centres are at +0.5.
    #[default = true]
    normalized: bool,
}

/// What lies beyond the edges.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Address {
    /// The image again.
    Repeat,
    /// The image reflected, again and again.
    MirrorRepeat,
    /// The nearest edge pixel.
    #[default]
    ClampToEdge,
    /// Transparent black.
    ClampToBorder,
}

/// Between pixel centres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Sampling {
    /// The pixel that holds the point.
    Nearest,
    /// Bilinear, in a volume trilinear.
    Linear,
}

pub(crate) const KIND: Kind = Kind::of::<SampleImage>(
    "SampleImage",
    Category::Composite,
    &[
        r#"SampleImage(image: "in", coords: "pair")"#,
        r#"SampleImage(image: "in", coords: "other", address: Repeat)"#,
        r#"SampleImage(image: "in", coords: "other", address: MirrorRepeat, filter: Linear)"#,
        r#"SampleImage(image: "grey", coords: "other", address: ClampToEdge, filter: Nearest)"#,
        r#"SampleImage(image: "in", coords: "other", address: ClampToBorder)"#,
        r#"SampleImage(image: "in", coords: "other", address: MirrorRepeat, filter: Nearest, normalized: false)"#,
        r#"SampleImage(image: "volume", coords: "other", address: Repeat)"#,
        r#"SampleImage(image: "fog", coords: "other", address: ClampToBorder)"#,
        r#"SampleImage(image: "volume", coords: "in", address: MirrorRepeat, filter: Nearest)"#,
    ],
)
.tolerance(1e-5, 1e-5);

impl Address {
    const fn border(self) -> Border {
        match self {
            Self::Repeat => Border::Repeat,
            Self::MirrorRepeat => Border::Mirror,
            Self::ClampToEdge => Border::Clamp,
            Self::ClampToBorder => Border::Black,
        }
    }
}

impl Node for SampleImage {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let coords = inputs.image(&self.coords);
        let (channels, precision) = match inputs.ty(self.image.edge) {
            EdgeType::Volume(t) => (t.channels, t.precision),
            EdgeType::Image(t) => (t.channels, t.precision),
            other => return Err(Mistake::in_field("image", format!("is a {other}")).hint("expected an Image or a Volume")),
        };
        Ok(Output::out(EdgeType::Image(ImageType { size: coords.size, channels, precision })))
    }

    fn makes_alpha(&self) -> bool {
        matches!(self.address, Address::ClampToBorder)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, coords, out) = (cx.input(&self.image), cx.input(&self.coords), cx.output("out"));
        let shader = match cx.shape(image) {
            Shape::Volume(_) => shader!("composite/sample_volume"),
            _ => shader!("composite/sample_image"),
        };
        cx.pass("", shader)
            .read_with("image", image, Reach::Whole, self.address.border(), Filter::Nearest)
            .read("coords", coords, Reach::Point)
            .write("out", out)
            .constant("LINEAR", self.filter == Sampling::Linear)
            .constant("NORMALIZED", self.normalized)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let coords = cx.image(&self.coords);
        let input = cx.input(&self.image);
        let (size, channels) = match input {
            Tensor::Volume(block) => (block.size, block.channels),
            Tensor::Image(image) => ([image.size[0], image.size[1], 1], image.channels),
            _ => unreachable!("`outputs` has checked the type"),
        };
        let border = self.address.border();
        let load = |at: [i64; 3]| match input {
            Tensor::Volume(block) => block.load(at, border),
            Tensor::Image(image) => image.load(at[0], at[1], border),
            _ => [0.0; 4],
        };
        let flat = matches!(input, Tensor::Image(_));
        let out = Raster::from_fn(coords.size, channels, |x, y| {
            let at = coords.at(x, y);
            let place: [f64; 3] = std::array::from_fn(|i| {
                if flat && i == 2 {
                    0.5
                } else if self.normalized {
                    at[i] * f64::from(size[i])
                } else {
                    at[i]
                }
            });
            if self.filter == Sampling::Nearest {
                return load(place.map(|v| v.floor() as i64));
            }
            let mut sum = [0.0; 4];
            for corner in 0..8 {
                let mut weight = 1.0;
                let mut index = [0; 3];
                for (axis, p) in place.iter().enumerate() {
                    let low = (p - 0.5).floor();
                    let far = corner >> axis & 1;
                    let fraction = p - 0.5 - low;
                    weight *= if far == 1 { fraction } else { 1.0 - fraction };
                    index[axis] = low as i64 + far;
                }
                if weight != 0.0 {
                    let v = load(index);
                    (0..4).for_each(|c| sum[c] += weight * v[c]);
                }
            }
            sum
        });
        vec![Tensor::Image(out)]
    }
}

#[cfg(test)]
mod tests {
    use pipe_graph::reference::border_index;

    use super::*;

    /// OpenGL 4.6, table 8.20: wrap modes of texel indices.
    #[test]
    fn addresses_as_opengl() {
        let row = |address: Address| [-4, -1, 0, 2, 3, 6].map(|i| border_index(i, 3, address.border()));
        assert_eq!(row(Address::Repeat), [2, 2, 0, 2, 0, 0].map(Some));
        assert_eq!(row(Address::MirrorRepeat), [2, 0, 0, 2, 2, 0].map(Some));
        assert_eq!(row(Address::ClampToEdge), [0, 0, 0, 2, 2, 2].map(Some));
        assert_eq!(row(Address::ClampToBorder), [None, None, Some(0), Some(2), None, None]);
    }
}
