//! `Mix`: fades from one image to another.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::shader;

/// a·(1 − t) + b·t, in all channels, with t = factor, or factor times the mask: a dissolve, a keyed mix.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Mix {
    /// The image at t = 0.
    a: In<Image>,
    /// The image at t = 1, of the same size.
    b: In<Image>,
    /// Share of `b`. Values outside 0..1 extrapolate.
    #[default(Driven::Value(0.5))]
    #[schemars(range(min = -16.0, max = 16.0))]
    factor: Driven,
    /// Multiplies the factor at each pixel: the value of a 1-channel image, the luminance of a colour one (`Shuffle`
    /// brings another channel there). Of the same size.
    mask: Option<In<Image>>,
}

pub(crate) const KIND: Kind = Kind::of::<Mix>(
    "Mix",
    Category::Composite,
    &[
        r#"Mix(a: "in", b: "other")"#,
        r#"Mix(a: "in", b: "other", factor: 0.25, mask: "grey")"#,
        r#"Mix(a: "in", b: "other", factor: "scalar")"#,
        r#"Mix(a: "in", b: "grey", factor: 0.75, mask: "other")"#,
        r#"Mix(a: "grey", b: "grey", factor: 1, mask: "in")"#,
    ],
)
.tolerance(1e-5, 1e-5);

impl Node for Mix {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let out = inputs.same_size(&[("a", &self.a), ("b", &self.b)])?;
        if let Some(mask) = &self.mask {
            inputs.same_size(&[("a", &self.a), ("mask", mask)])?;
        }
        Ok(Output::out(EdgeType::Image(out)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (a, b, out) = (cx.input(&self.a), cx.input(&self.b), cx.output("out"));
        let mask = self.mask.map(|mask| cx.input(&mask));
        let shader = if mask.is_some() { shader!("composite/mix_masked") } else { shader!("composite/mix") };
        let mut pass = cx.pass("", shader).entry(Entry::Point).read("a", a, Reach::Point).read("b", b, Reach::Point);
        if let Some(mask) = mask {
            pass = pass.read("mask", mask, Reach::Point);
        }
        pass.write("out", out).driven("factor", &self.factor).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (a, b) = (cx.image(&self.a), cx.image(&self.b));
        let mask = self.mask.map(|mask| cx.image(&mask));
        let factor = cx.driven(&self.factor);
        let out = Raster::from_fn(a.size, a.channels.max(b.channels), |x, y| {
            let t = factor * mask.map_or(1.0, |mask| luminance(mask.at(x, y)));
            let (a, b) = (a.at(x, y), b.at(x, y));
            std::array::from_fn(|c| a[c] * (1.0 - t) + b[c] * t)
        });
        vec![Tensor::Image(out)]
    }
}
