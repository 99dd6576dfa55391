//! `Merge`: layers one image onto another, with associated alpha.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::arithmetic::{maximum, minimum, quotient};
use crate::shader;

/// Layers `a` onto `b`; both have associated (premultiplied) alpha. As in Nuke, the operation acts on alpha exactly as on
/// the colours, and negative and bright values are kept.
///
/// Porter & Duff 1984 for the operators that look at alpha; Nuke's Merge for all others.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Merge {
    /// The upper image.
    a: In<Image>,
    /// The lower image, of the same size.
    b: In<Image>,
    /// How a pixel A of `a` (with alpha α) and B of `b` (with alpha β) are joined.
    op: Op,
    /// Between `b` (0) and the full result (1).
    #[default = 1.0]
    #[schemars(range(min = 0.0, max = 1.0))]
    mix: f32,
}

/// How two layers are joined.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Op {
    /// A + B(1−α)
    #[default]
    Over,
    /// A(1−β) + B
    Under,
    /// Aβ
    In,
    /// A(1−β)
    Out,
    /// Aβ + B(1−α)
    Atop,
    /// A(1−β) + B(1−α)
    Xor,
    /// A + B
    Plus,
    /// A − B
    Minus,
    /// |A − B|
    Difference,
    /// AB; A where both are negative.
    Multiply,
    /// A + B − AB where both are within 0..1, else the larger.
    Screen,
    /// 2AB where B < 0.5, else 1 − 2(1−A)(1−B).
    Overlay,
    /// B(2A + B(1−AB)) where AB < 1, else 2AB.
    SoftLight,
    /// A/B; 0 where B = 0 or both are negative.
    Divide,
    /// The larger.
    Max,
    /// The smaller.
    Min,
}

pub(crate) const KIND: Kind = Kind::of::<Merge>(
    "Merge",
    Category::Composite,
    &[
        r#"Merge(a: "in", b: "other")"#,
        r#"Merge(a: "in", b: "other", op: Over, mix: 0.25)"#,
        r#"Merge(a: "in", b: "other", op: Under)"#,
        r#"Merge(a: "in", b: "other", op: In)"#,
        r#"Merge(a: "in", b: "other", op: Out)"#,
        r#"Merge(a: "in", b: "other", op: Atop)"#,
        r#"Merge(a: "in", b: "other", op: Xor)"#,
        r#"Merge(a: "in", b: "other", op: Plus)"#,
        r#"Merge(a: "in", b: "other", op: Minus)"#,
        r#"Merge(a: "in", b: "other", op: Difference)"#,
        r#"Merge(a: "in", b: "other", op: Multiply)"#,
        r#"Merge(a: "in", b: "other", op: Screen)"#,
        r#"Merge(a: "in", b: "other", op: Overlay)"#,
        r#"Merge(a: "in", b: "other", op: SoftLight)"#,
        r#"Merge(a: "in", b: "other", op: Divide)"#,
        r#"Merge(a: "in", b: "other", op: Max)"#,
        r#"Merge(a: "in", b: "other", op: Min, mix: 0.5)"#,
        r#"Merge(a: "grey", b: "in", op: Multiply)"#,
        r#"Merge(a: "grey", b: "grey", op: Plus)"#,
    ],
)
// Overlay and SoftLight of bright pixels subtract products of several values.
.tolerance(1e-5, 1e-5);

impl Op {
    /// One channel: A and B with the alphas of their pixels.
    fn of(self, a: f64, b: f64, alpha: f64, beta: f64) -> f64 {
        match self {
            Self::Over => a + b * (1.0 - alpha),
            Self::Under => a * (1.0 - beta) + b,
            Self::In => a * beta,
            Self::Out => a * (1.0 - beta),
            Self::Atop => a * beta + b * (1.0 - alpha),
            Self::Xor => a * (1.0 - beta) + b * (1.0 - alpha),
            Self::Plus => a + b,
            Self::Minus => a - b,
            Self::Difference => (a - b).abs(),
            Self::Multiply if a < 0.0 && b < 0.0 => a,
            Self::Multiply => a * b,
            Self::Screen if (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b) => a + b - a * b,
            Self::Screen | Self::Max => maximum(a, b),
            Self::Overlay if b < 0.5 => 2.0 * a * b,
            Self::Overlay => 1.0 - 2.0 * (1.0 - a) * (1.0 - b),
            Self::SoftLight if a * b < 1.0 => b * (2.0 * a + b * (1.0 - a * b)),
            Self::SoftLight => 2.0 * a * b,
            Self::Divide if a < 0.0 && b < 0.0 => 0.0,
            Self::Divide => quotient(a, b),
            Self::Min => minimum(a, b),
        }
    }
}

impl Node for Merge {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.same_size(&[("a", &self.a), ("b", &self.b)])?)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (a, b, out) = (cx.input(&self.a), cx.input(&self.b), cx.output("out"));
        cx.pass("", shader!("composite/merge"))
            .entry(Entry::Point)
            .read("a", a, Reach::Point)
            .read("b", b, Reach::Point)
            .write("out", out)
            .constant("OP", self.op as i32)
            .constant("WHOLE", self.mix == 1.0)
            .param("mix", self.mix)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (a, b) = (cx.image(&self.a), cx.image(&self.b));
        let mix = f64::from(self.mix);
        let out = Raster::from_fn(a.size, a.channels.max(b.channels), |x, y| {
            let (a, b) = (a.at(x, y), b.at(x, y));
            std::array::from_fn(|c| {
                let full = self.op.of(a[c], b[c], a[3], b[3]);
                if mix == 1.0 { full } else { b[c] * (1.0 - mix) + full * mix }
            })
        });
        vec![Tensor::Image(out)]
    }
}
