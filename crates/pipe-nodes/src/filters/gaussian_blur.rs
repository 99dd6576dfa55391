//! `GaussianBlur`: both axes.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::gaussian::{blur, separable, separable_reference, unbounded_reference};
use crate::filters::importance::{importance, importance_reference};
use crate::filters::pyramid::pyramid;
use crate::filters::recursive::recursive;

/// Blurs with a Gaussian along both axes.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct GaussianBlur {
    /// The image.
    image: In<Image>,
    /// Standard deviation: one number, or (σx, σy).
    #[schemars(extend("minimum" = 0.0, "maximum" = 1000.0, "x-unit" = "px"))]
    sigma: Sigma,
    /// How it is computed. `Separable` is exact with radius ceil(3σ). `Recursive` costs the same for every σ, `Pyramid` less
    /// for larger ones, for it works on a smaller image; both are within 1e-3 of the range of the (unbounded) Gaussian.
    /// `Importance(samples: n)` takes n equally weighted samples along each axis. `Auto` is, for each axis, Separable up to
    /// a radius of 24 (on a CPU 20), where it is the fastest, and Recursive beyond.
    method: Method,
}

/// One deviation or two.
#[derive(Debug, Clone, Copy, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
enum Sigma {
    /// Both axes alike.
    #[default]
    Both(#[default = 2.0] f32),
    /// x and y.
    Each([f32; 2]),
}

/// How a Gaussian blur is computed.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
enum Method {
    /// Whatever is fastest.
    #[default]
    Auto,
    /// Two convolutions, exact.
    Separable,
    /// Infinite impulse responses, within 1e-3 of the range.
    Recursive,
    /// On a smaller image, within 1e-3 of the range.
    Pyramid,
    /// Equally weighted samples at quantiles.
    Importance {
        /// Samples along each axis.
        #[serde(default = "five")]
        samples: u32,
    },
}

const fn five() -> u32 {
    5
}

pub(super) const KIND: Kind = Kind::of::<GaussianBlur>(
    "GaussianBlur",
    Category::Filters,
    &[
        r#"GaussianBlur(image: "in", sigma: 3)"#,
        r#"GaussianBlur(image: "in", sigma: (1.5, 4.0), method: Separable)"#,
        r#"GaussianBlur(image: "grey", sigma: 0.5)"#,
        r#"GaussianBlur(image: "in", sigma: 2, method: Importance(samples: 7))"#,
        r#"GaussianBlur(image: "in", sigma: 6, method: Recursive)"#,
        r#"GaussianBlur(image: "grey", sigma: (40, 1.5), method: Recursive)"#,
        r#"GaussianBlur(image: "in", sigma: (7, 0), method: Recursive)"#,
        r#"GaussianBlur(image: "in", sigma: 9, method: Pyramid)"#,
        r#"GaussianBlur(image: "grey", sigma: (3, 35), method: Pyramid)"#,
    ],
)
// What `Recursive` and `Pyramid` promise; the others are exact, as BlurH and BlurV prove.
.tolerance(1e-3, 1e-3);

impl GaussianBlur {
    const fn sigma(&self) -> [f32; 2] {
        match self.sigma {
            Sigma::Both(s) => [s, s],
            Sigma::Each(s) => s,
        }
    }
}

impl Node for GaussianBlur {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        match self.method {
            Method::Importance { samples } if !(1..=1024).contains(&samples) => {
                Err(Mistake::in_field("method", format!("takes {samples} samples")).hint("expected 1 to 1024"))
            }
            _ => Ok(()),
        }
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        if self.sigma() == [0.0, 0.0] && cx.pass_on("out", image) {
            return Ok(());
        }
        let out = cx.output("out");
        match self.method {
            Method::Importance { samples } => importance(cx, self.sigma(), samples, image, out),
            Method::Auto => blur(cx, "", self.sigma(), image, out),
            Method::Separable => separable(cx, "", self.sigma(), image, out),
            Method::Recursive => recursive(cx, self.sigma(), image, out),
            Method::Pyramid => pyramid(cx, self.sigma(), image, out),
        }
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        vec![Tensor::Image(match self.method {
            Method::Importance { samples } => importance_reference(image, self.sigma(), samples, cx.border),
            Method::Recursive | Method::Pyramid => unbounded_reference(image, self.sigma(), cx.border),
            Method::Auto | Method::Separable => separable_reference(image, self.sigma(), cx.border),
        })]
    }
}
