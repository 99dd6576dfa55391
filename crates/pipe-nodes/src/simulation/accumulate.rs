//! `Accumulate`: what the frames of a sequence come to.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::state::widened;
use crate::shader;

/// Joins the frames of a sequence, each with all before it: noise averages out, trails stay. In all channels. A single
/// image, and the first frame, pass as they are.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Accumulate {
    /// The frame.
    image: In<Image>,
    /// How it is joined with the frames before.
    op: Op,
}

/// How a frame is joined with the frames before.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Op {
    /// The mean of all frames so far.
    #[default]
    Mean,
    /// Exponential moving average: alpha·frame + (1 − alpha)·average before.
    Ema {
        /// Weight of the new frame, 0..1.
        #[serde(default = "tenth")]
        alpha: f32,
    },
    /// The largest value so far, channel by channel.
    Max,
}

const fn tenth() -> f32 {
    0.1
}

pub(crate) const KIND: Kind = Kind::of::<Accumulate>(
    "Accumulate",
    Category::Simulation,
    &[r#"Accumulate(image: "in")"#, r#"Accumulate(image: "in", op: Ema(alpha: 0.2))"#, r#"Accumulate(image: "grey", op: Max)"#],
);

impl Node for Accumulate {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        match self.op {
            Op::Ema { alpha } if !(0.0..=1.0).contains(&alpha) => {
                Err(Mistake::in_field("op", format!("alpha is {alpha}")).hint("expected 0 to 1"))
            }
            _ => Ok(()),
        }
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let image = inputs.image(&self.image);
        Ok(Output::out(EdgeType::image(image.size, image.channels)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let Some(frames_before) = cx.frames_before() else {
            return Err(Mistake::new("frames do not pass inside an iteration").hint("put Accumulate outside of it"));
        };
        let image = cx.input(&self.image);
        let image = widened(cx, image);
        let shape = cx.shape(image);
        let is_first = frames_before == 0;
        // How many frames there are is counted on the GPU, so that the plan is the same for every frame after the first.
        let mut counted = None;
        if self.op == Op::Mean {
            let count = cx.intermediate("count", Shape::Scalar);
            if is_first {
                cx.pass("count", shader!("simulation/count_first")).write("out", count).add();
            } else {
                let before = cx.recall("count", Shape::Scalar);
                cx.pass("count", shader!("simulation/count_next")).read("before", before, Reach::Whole).write("out", count).add();
            }
            cx.keep("count", count);
            counted = Some(count);
        }
        let out = if is_first {
            image
        } else {
            let (before, out) = (cx.recall("joined", shape), cx.intermediate("joined", shape));
            let (op, alpha) = match self.op {
                Op::Mean => (0, Value::F32(0.0)),
                Op::Ema { alpha } => (0, Value::F32(alpha)),
                Op::Max => (1, Value::F32(0.0)),
            };
            let weight = counted.map_or(alpha, Value::Driven);
            cx.pass("", shader!("simulation/accumulate"))
                .entry(Entry::Point)
                .read("image", image, Reach::Point)
                .read("before", before, Reach::Point)
                .write("out", out)
                .constant("OP", op)
                .constant("COUNTED", counted.is_some())
                .param("weight", weight)
                .add();
            out
        };
        cx.keep("joined", out);
        cx.emit("out", out);
        Ok(())
    }

    /// The first frame.
    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        vec![Tensor::Image(cx.image(&self.image).clone())]
    }
}
