//! `Shuffle`: channels in another order.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{point, untouched};
use crate::shader;

/// Fills each channel from a channel of the input, or with 0 or 1. The output has 4 channels.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Shuffle {
    /// The image.
    image: In<Image>,
    /// What red becomes.
    #[default(Channel::R)]
    r: Channel,
    /// What green becomes.
    #[default(Channel::G)]
    g: Channel,
    /// What blue becomes.
    #[default(Channel::B)]
    b: Channel,
    /// What alpha becomes.
    #[default(Channel::A)]
    a: Channel,
}

/// Where a channel comes from.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
enum Channel {
    /// Red.
    R,
    /// Green.
    G,
    /// Blue.
    B,
    /// Alpha.
    A,
    /// 0
    Zero,
    /// 1
    One,
}

pub(super) const KIND: Kind = Kind::of::<Shuffle>(
    "Shuffle",
    Category::Colour,
    &[r#"Shuffle(image: "in", r: B, b: R)"#, r#"Shuffle(image: "in", r: A, g: Zero, b: One, a: R)"#, r#"Shuffle(image: "grey", a: Zero)"#],
)
.tolerance(0.0, 0.0);

impl Shuffle {
    /// Whether every channel stays where it is.
    const fn is_neutral(&self) -> bool {
        matches!((self.r, self.g, self.b, self.a), (Channel::R, Channel::G, Channel::B, Channel::A))
    }
}

impl Node for Shuffle {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image).with_channels(4))))
    }

    fn makes_alpha(&self) -> bool {
        !matches!(self.a, Channel::A | Channel::One)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        if untouched(cx, &self.image, self.is_neutral()) {
            return Ok(());
        }
        let mut pass = point(cx, &self.image, shader!("colour/shuffle"));
        for (name, channel) in [("RED", self.r), ("GREEN", self.g), ("BLUE", self.b), ("ALPHA", self.a)] {
            pass = pass.constant(name, channel as i32);
        }
        pass.add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let pick = |p: [f64; 4], c: Channel| match c {
            Channel::R => p[0],
            Channel::G => p[1],
            Channel::B => p[2],
            Channel::A => p[3],
            Channel::Zero => 0.0,
            Channel::One => 1.0,
        };
        vec![Tensor::Image(cx.image(&self.image).map(4, |p| [pick(p, self.r), pick(p, self.g), pick(p, self.b), pick(p, self.a)]))]
    }
}
