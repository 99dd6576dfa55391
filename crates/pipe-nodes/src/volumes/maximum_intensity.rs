//! `MaximumIntensity`: the brightest voxel along every eye ray.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::bricks::{extremes, with_bricks};
use super::camera::Camera;
use crate::shader;

/// Maximum intensity projection. Each pixel is the greatest value, channel by channel, that its eye ray meets in the
/// volume, interpolated trilinearly; 0 where it misses the unit cube.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct MaximumIntensity {
    /// The volume.
    volume: In<Volume>,
    /// Where it is seen from.
    camera: Camera,
    /// Samples along a ray, evenly between the faces of the cube.
    #[default = 256]
    #[schemars(range(min = 1, max = 4096))]
    steps: u32,
}

pub(super) const KIND: Kind = Kind::of::<MaximumIntensity>(
    "MaximumIntensity",
    Category::Volumes,
    &[
        r#"MaximumIntensity(volume: "volume", camera: (size: (33, 25)))"#,
        r#"MaximumIntensity(volume: "fog", camera: (eye: (2, 1.5, -1), size: (24, 24)), steps: 64)"#,
        r#"MaximumIntensity(volume: "fog", camera: (eye: (0.4, 0.5, 0.3), target: (1, 1, 1), fov: 100, size: (19, 23)), steps: 100)"#,
    ],
)
.tolerance(1e-5, 1e-5);

impl Node for MaximumIntensity {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(self.camera.image(inputs.volume(&self.volume).channels)?))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (volume, out) = (cx.input(&self.volume), cx.output("out"));
        let Shape::Volume(ty) = cx.shape(volume) else { unreachable!("the resolver bound a volume") };
        let bricks = extremes(cx, volume, Border::Clamp, true);
        let pass = cx.pass("", with_bricks(&shader!("volumes/maximum_intensity")));
        self.camera
            .describe(pass)
            .read_with("volume", volume, Reach::Whole, Border::Clamp, Filter::Linear)
            .read_with("bricks", bricks, Reach::Whole, Border::Clamp, Filter::Nearest)
            .write("out", out)
            .constant("GREY", ty.channels == 1)
            .param("steps", self.steps as i32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let volume = cx.volume(&self.volume);
        vec![Tensor::Image(self.camera.view().picture(volume.channels, |ray| {
            let Some([enter, leave]) = ray.cube_span() else { return [0.0; 4] };
            let mut most = [f64::NEG_INFINITY; 4];
            for i in 0..self.steps {
                let distance = enter + (leave - enter) * (f64::from(i) + 0.5) / f64::from(self.steps);
                let v = volume.sample(ray.at(distance).to_array(), Border::Clamp);
                most = std::array::from_fn(|c| most[c].max(v[c]));
            }
            most
        }))]
    }
}
