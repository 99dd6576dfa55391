//! `Math`: arithmetic between images and numbers.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::arithmetic::{maximum, minimum, modulo, power, quotient};
use crate::shader;

/// Joins two images, or an image and a number, by one operation on each colour channel. Alpha is kept: that of `a`,
/// or of `b` when `a` is a number. What has no value in the real numbers is 0.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Math {
    /// The left operand: an image or a number.
    a: Operand,
    /// The right operand: an image of the same size or a number. `Abs`, `Sqrt`, `Exp` and `Log` have none.
    b: Option<Operand>,
    /// What to compute.
    op: Op,
}

/// What to compute.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
enum Op {
    /// a + b
    #[default]
    Add,
    /// a − b
    Sub,
    /// a·b
    Mul,
    /// a/b; 0 where b = 0.
    Div,
    /// a^b; 0 where a < 0 and b is no whole number, and where a = 0 and b < 0.
    Pow,
    /// The smaller.
    Min,
    /// The larger.
    Max,
    /// |a|
    Abs,
    /// √a; 0 where a < 0.
    Sqrt,
    /// e^a, at most e^88 (near the largest float) of what is finite.
    Exp,
    /// ln a; values below the smallest normal float, 2^−126, count as that (−87.3).
    Log,
    /// a − b·⌊a/b⌋, which has the sign of b; 0 where b = 0.
    Mod,
}

pub(crate) const KIND: Kind = Kind::of::<Math>(
    "Math",
    Category::Composite,
    &[
        r#"Math(a: "in", b: 2, op: Mul)"#,
        r#"Math(a: "in", b: "other")"#,
        r#"Math(a: 1, b: "in", op: Sub)"#,
        r#"Math(a: "in", b: "other", op: Sub)"#,
        r#"Math(a: "in", b: "grey", op: Mul)"#,
        r#"Math(a: "in", b: "other", op: Div)"#,
        r#"Math(a: "in", b: 0.45, op: Pow)"#,
        r#"Math(a: "in", b: 3, op: Pow)"#,
        r#"Math(a: "in", b: "other", op: Min)"#,
        r#"Math(a: "in", b: 0.5, op: Max)"#,
        r#"Math(a: "in", op: Abs)"#,
        r#"Math(a: "in", op: Sqrt)"#,
        r#"Math(a: "in", op: Exp)"#,
        r#"Math(a: "in", op: Log)"#,
        r#"Math(a: "in", b: 0.3, op: Mod)"#,
        r#"Math(a: "grey", b: "grey", op: Mul)"#,
        r#"Math(a: "pair", op: Abs)"#,
    ],
)
// Devices compute pow, exp and log to a few units of the sixth digit.
.tolerance(2e-6, 5e-5);

impl Op {
    const fn is_unary(self) -> bool {
        matches!(self, Self::Abs | Self::Sqrt | Self::Exp | Self::Log)
    }

    fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Sub => a - b,
            Self::Mul => a * b,
            Self::Div => quotient(a, b),
            Self::Pow => power(a, b),
            Self::Min => minimum(a, b),
            Self::Max => maximum(a, b),
            Self::Abs => a.abs(),
            Self::Sqrt => maximum(a, 0.0).sqrt(),
            Self::Exp if a == f64::INFINITY => a,
            Self::Exp => minimum(a, 88.0).exp(),
            Self::Log => maximum(a, f64::from(f32::MIN_POSITIVE)).ln(),
            Self::Mod => modulo(a, b),
        }
    }
}

impl Math {
    /// The images among the operands, with their field names.
    fn images(&self) -> Vec<(&'static str, In<Image>)> {
        let image = |name, operand: Option<Operand>| match operand {
            Some(Operand::Image(port)) => Some((name, port)),
            _ => None,
        };
        let b = if self.op.is_unary() { None } else { self.b };
        [image("a", Some(self.a)), image("b", b)].into_iter().flatten().collect()
    }
}

impl Node for Math {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        match (self.op.is_unary(), &self.b) {
            (true, Some(_)) => inputs.warn(Mistake::in_field("b", format!("`{:?}` has one operand; `b` is ignored", self.op))),
            (false, None) => {
                return Err(Mistake::in_field("b", format!("`{:?}` needs a second operand", self.op)).hint("give `b` an image or a number"));
            }
            _ => {}
        }
        let images = self.images();
        if images.is_empty() {
            return Err(Mistake::in_field("a", "no operand is an image").hint("name an image for `a` or `b`"));
        }
        let ports: Vec<_> = images.iter().map(|(name, port)| (*name, port)).collect();
        Ok(Output::out(EdgeType::Image(inputs.same_size(&ports)?)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let shader = match (self.a, self.b) {
            (Operand::Image(_), Some(Operand::Image(_))) if !self.op.is_unary() => shader!("composite/math"),
            (Operand::Image(_), _) => shader!("composite/math_number_right"),
            (Operand::Number(_), _) => shader!("composite/math_number_left"),
        };
        // What all three share is one text.
        let shared = shader!("composite/math_operation");
        let shader = Shader::builtin(&shader.path, &format!("{}\n{}", shared.source, shader.source));
        let out = cx.output("out");
        let number = match (self.a, self.b) {
            (Operand::Number(v), _) | (_, Some(Operand::Number(v))) => v,
            _ => 0.0,
        };
        let images: Vec<_> = self.images().into_iter().map(|(name, port)| (name, cx.input(&port))).collect();
        let mut pass = cx.pass("", shader).entry(Entry::Point);
        for (name, image) in images {
            pass = pass.read(name, image, Reach::Point);
        }
        pass.write("out", out).constant("OP", self.op as i32).param("number", number).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let images = self.images();
        let first = cx.image(&images[0].1);
        let channels = images.iter().map(|(_, port)| cx.image(port).channels).max().unwrap_or(4);
        let value = |operand: Option<Operand>, x, y| match operand {
            Some(Operand::Image(port)) => cx.image(&port).at(x, y),
            Some(Operand::Number(v)) => [f64::from(v); 4],
            None => [0.0; 4],
        };
        let out = Raster::from_fn(first.size, channels, |x, y| {
            let a = value(Some(self.a), x, y);
            let b = if self.op.is_unary() { [0.0; 4] } else { value(self.b, x, y) };
            let [r, g, b] = [0, 1, 2].map(|c| self.op.of(a[c], b[c]));
            [r, g, b, first.at(x, y)[3]]
        });
        vec![Tensor::Image(out)]
    }
}
