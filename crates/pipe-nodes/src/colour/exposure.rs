//! `Exposure`: rgb·2^ev.

use pipe_graph::prelude::*;

use crate::shader;

/// Brightens or darkens by stops, as the shutter of a camera would: rgb·2^ev. Alpha is kept.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Exposure {
    /// The image to expose.
    image: In<Image>,
    /// Stops: each doubles the light.
    #[schemars(range(min = -64.0, max = 64.0), extend("x-unit" = "EV"))]
    ev: Driven,
}

pub(super) const KIND: Kind = Kind::of::<Exposure>(
    "Exposure",
    Category::Colour,
    &[r#"Exposure(image: "in", ev: 1.5)"#, r#"Exposure(image: "in", ev: "scalar")"#, r#"Exposure(image: "grey", ev: -2)"#],
);

impl Node for Exposure {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        if matches!(self.ev, Driven::Value(0.0)) && cx.pass_on("out", image) {
            return Ok(());
        }
        let out = cx.output("out");
        cx.pass("", shader!("colour/exposure"))
            .entry(Entry::Point)
            .read("image", image, Reach::Point)
            .write("out", out)
            .driven("ev", &self.ev)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let gain = cx.driven(&self.ev).exp2();
        let image = cx.image(&self.image);
        vec![Tensor::Image(image.map(image.channels, |[r, g, b, a]| [r * gain, g * gain, b * gain, a]))]
    }
}
