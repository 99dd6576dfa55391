//! `Blend`: the fixed-function blending of a graphics card, as a node.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::arithmetic::{maximum, minimum};
use crate::shader;

/// Blends as the output stage of a graphics card does: `equation(src·src_factor, dst·dst_factor)`, channel by channel,
/// alpha with the alpha of its factors. Nothing is clamped. The defaults lay `src` over `dst` (associated alpha).
///
/// After the OpenGL 4.6 specification, 17.3.6 (tables 17.1 and 17.2).
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Blend {
    /// What is drawn.
    src: In<Image>,
    /// What it is drawn onto, of the same size.
    dst: In<Image>,
    /// How the two products are joined. `ReverseSubtract` is dst − src; `Min` and `Max` ignore both factors.
    equation: Equation,
    /// What `src` is multiplied by.
    #[default(Factor::One)]
    src_factor: Factor,
    /// What `dst` is multiplied by.
    #[default(Factor::OneMinusSrcAlpha)]
    dst_factor: Factor,
    /// Red, green, blue and alpha for the `Constant…` factors.
    constant: [f32; 4],
}

/// How the two products are joined.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Equation {
    #[default]
    Add,
    Subtract,
    ReverseSubtract,
    Min,
    Max,
}

/// What a colour is multiplied by.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Factor {
    Zero,
    One,
    SrcColor,
    OneMinusSrcColor,
    DstColor,
    OneMinusDstColor,
    SrcAlpha,
    OneMinusSrcAlpha,
    DstAlpha,
    OneMinusDstAlpha,
    ConstantColor,
    OneMinusConstantColor,
    ConstantAlpha,
    OneMinusConstantAlpha,
    /// min(src alpha, 1 − dst alpha) for the colour, 1 for alpha.
    SrcAlphaSaturate,
}

pub(crate) const KIND: Kind = Kind::of::<Blend>(
    "Blend",
    Category::Composite,
    &[
        r#"Blend(src: "in", dst: "other")"#,
        r#"Blend(src: "in", dst: "other", equation: Add, src_factor: SrcAlpha, dst_factor: OneMinusSrcAlpha)"#,
        r#"Blend(src: "in", dst: "other", equation: Subtract, src_factor: OneMinusDstColor, dst_factor: SrcColor)"#,
        r#"Blend(src: "in", dst: "other", equation: ReverseSubtract, src_factor: DstColor, dst_factor: OneMinusSrcColor)"#,
        r#"Blend(src: "in", dst: "other", equation: Min, src_factor: Zero, dst_factor: Zero)"#,
        r#"Blend(src: "in", dst: "other", equation: Max, src_factor: Zero)"#,
        r#"Blend(src: "in", dst: "other", src_factor: DstAlpha, dst_factor: OneMinusDstAlpha)"#,
        r#"Blend(src: "in", dst: "other", src_factor: ConstantColor, dst_factor: OneMinusConstantColor, constant: [0.25, 0.5, 0.75, 0.9])"#,
        r#"Blend(src: "in", dst: "other", src_factor: ConstantAlpha, dst_factor: OneMinusConstantAlpha, constant: [0.25, 0.5, 0.75, 0.9])"#,
        r#"Blend(src: "in", dst: "other", src_factor: SrcAlphaSaturate, dst_factor: One)"#,
        r#"Blend(src: "grey", dst: "in", dst_factor: One)"#,
        r#"Blend(src: "grey", dst: "grey", src_factor: SrcColor, dst_factor: Zero)"#,
    ],
);

impl Factor {
    fn of(self, s: [f64; 4], d: [f64; 4], k: [f32; 4]) -> [f64; 4] {
        let k = k.map(f64::from);
        let f = (s[3]).min(1.0 - d[3]);
        match self {
            Self::Zero => [0.0; 4],
            Self::One => [1.0; 4],
            Self::SrcColor => s,
            Self::OneMinusSrcColor => s.map(|v| 1.0 - v),
            Self::DstColor => d,
            Self::OneMinusDstColor => d.map(|v| 1.0 - v),
            Self::SrcAlpha => [s[3]; 4],
            Self::OneMinusSrcAlpha => [1.0 - s[3]; 4],
            Self::DstAlpha => [d[3]; 4],
            Self::OneMinusDstAlpha => [1.0 - d[3]; 4],
            Self::ConstantColor => k,
            Self::OneMinusConstantColor => k.map(|v| 1.0 - v),
            Self::ConstantAlpha => [k[3]; 4],
            Self::OneMinusConstantAlpha => [1.0 - k[3]; 4],
            Self::SrcAlphaSaturate => [f, f, f, 1.0],
        }
    }
}

impl Node for Blend {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.same_size(&[("src", &self.src), ("dst", &self.dst)])?)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (src, dst, out) = (cx.input(&self.src), cx.input(&self.dst), cx.output("out"));
        cx.pass("", shader!("composite/blend"))
            .entry(Entry::Point)
            .read("src", src, Reach::Point)
            .read("dst", dst, Reach::Point)
            .write("out", out)
            .constant("EQUATION", self.equation as i32)
            .constant("SRC_FACTOR", self.src_factor as i32)
            .constant("DST_FACTOR", self.dst_factor as i32)
            .param("constant", self.constant)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (src, dst) = (cx.image(&self.src), cx.image(&self.dst));
        let channels = src.channels.max(dst.channels);
        let out = Raster::from_fn(src.size, channels, |x, y| {
            let (s, d) = (src.at(x, y), dst.at(x, y));
            let (fs, fd) = (self.src_factor.of(s, d, self.constant), self.dst_factor.of(s, d, self.constant));
            std::array::from_fn(|c| match self.equation {
                Equation::Add => s[c] * fs[c] + d[c] * fd[c],
                Equation::Subtract => s[c] * fs[c] - d[c] * fd[c],
                Equation::ReverseSubtract => d[c] * fd[c] - s[c] * fs[c],
                Equation::Min => minimum(s[c], d[c]),
                Equation::Max => maximum(s[c], d[c]),
            })
        });
        vec![Tensor::Image(out)]
    }
}
