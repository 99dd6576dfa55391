//! `VolumeSlice`: a plane of a volume as an image.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// The plane of a volume at a place along one axis, interpolated linearly between the two nearest slices. Rows and columns
/// keep the order of the volume: along z, pixel (x, y) is voxel (x, y); along y, voxel (x, z); along x, voxel (y, z).
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct VolumeSlice {
    /// The volume.
    volume: In<Volume>,
    /// What the plane is perpendicular to.
    #[default(Axis::Z)]
    axis: Axis,
    /// Where along it: 0 and 1 are the faces of the unit cube.
    #[default(0.5.into())]
    #[schemars(range(min = 0.0, max = 1.0))]
    position: Driven,
}

/// An axis of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[allow(missing_docs)]
enum Axis {
    X,
    Y,
    Z,
}

pub(super) const KIND: Kind = Kind::of::<VolumeSlice>(
    "VolumeSlice",
    Category::Volumes,
    &[
        r#"VolumeSlice(volume: "volume")"#,
        r#"VolumeSlice(volume: "volume", axis: Y, position: 0.37)"#,
        r#"VolumeSlice(volume: "fog", axis: X, position: 1)"#,
        r#"VolumeSlice(volume: "fog", position: "scalar")"#,
    ],
);

impl Axis {
    /// The axes of the volume that are the image's columns and rows.
    const fn plane(self) -> [usize; 2] {
        match self {
            Self::X => [1, 2],
            Self::Y => [0, 2],
            Self::Z => [0, 1],
        }
    }
}

impl Node for VolumeSlice {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let volume = inputs.volume(&self.volume);
        let size = self.axis.plane().map(|axis| volume.size[axis]);
        Ok(Output::out(EdgeType::image(size, volume.channels)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (volume, out) = (cx.input(&self.volume), cx.output("out"));
        cx.pass("", shader!("volumes/volume_slice"))
            .read_with("volume", volume, Reach::Whole, Border::Clamp, Filter::Nearest)
            .write("out", out)
            .constant("AXIS", self.axis as i32)
            .driven("position", &self.position)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let volume = cx.volume(&self.volume);
        let ([column, row], across) = (self.axis.plane(), self.axis as usize);
        let place = cx.driven(&self.position) * f64::from(volume.size[across]) - 0.5;
        let fraction = place - place.floor();
        vec![Tensor::Image(Raster::from_fn([volume.size[column], volume.size[row]], volume.channels, |x, y| {
            let slice = |number: f64| {
                let mut at = [number as i64; 3];
                (at[column], at[row]) = (x, y);
                volume.load(at, Border::Clamp)
            };
            let (near, far) = (slice(place.floor()), slice(place.floor() + 1.0));
            std::array::from_fn(|c| near[c] * (1.0 - fraction) + far[c] * fraction)
        }))]
    }
}
