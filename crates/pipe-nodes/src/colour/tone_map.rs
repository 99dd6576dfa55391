//! `ToneMap`, and its two halves `ScaleLuminance` and `ReinhardCurve`.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::analysis::reduction::{Mean, mean};
use crate::colour::curve::{LEAST_AVERAGE, Operator, tone_map};
use crate::colour::point::{map_rgb, point, same};
use crate::shader;

/// The ε of the logarithmic average (Reinhard et al. 2002, equation 1).
const EPSILON: f32 = 1e-6;

/// Maps scene-referred light to the display by its average luminance.
///
/// Yr = key·Y/average; with `Reinhard` D = Yr(1 + Yr/white²)/(1 + Yr), and colour is scaled by D/Y (0 where Y = 0).
/// E. Reinhard et al., Photographic Tone Reproduction for Digital Images, 2002. Alpha is kept.
///
/// The formula holds for negative light too; its pole at Yr = −1 is kept finite.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct ToneMap {
    /// The image.
    image: In<Image>,
    /// Average luminance Y′; the geometric mean of the image's luminance when absent.
    average: Option<Driven>,
    /// Brightness α that the average is mapped to.
    #[default(Driven::Value(0.18))]
    #[schemars(range(min = 0.0))]
    key: Driven,
    /// Smallest luminance W, after scaling, that is mapped to 1; for `Reinhard` and `Hable`.
    #[default(Driven::Value(4.0))]
    #[schemars(range(min = 1e-3))]
    white: Driven,
    /// The curve.
    operator: Operator,
}

pub(super) const TONE_MAP: Kind = Kind::of::<ToneMap>(
    "ToneMap",
    Category::Colour,
    &[
        r#"ToneMap(image: "in")"#,
        r#"ToneMap(image: "in", average: "scalar", key: 0.3, white: 2)"#,
        r#"ToneMap(image: "in", average: 0.5, operator: ReinhardSimple)"#,
        r#"ToneMap(image: "in", average: 0.5, operator: Hable)"#,
        r#"ToneMap(image: "in", average: 0.5, operator: AcesFit)"#,
        r#"ToneMap(image: "in", average: 0.5, operator: AgX)"#,
        r#"ToneMap(image: "in", average: 0.5, operator: Linear)"#,
        r#"ToneMap(image: "in", average: 0.01, key: 0.5, white: 1)"#,
        r#"ToneMap(image: "grey", key: "scalar")"#,
    ],
)
.tolerance(2e-6, 2e-5);

impl Node for ToneMap {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let average = match &self.average {
            Some(given) => cx.driven(given),
            None => {
                let image = cx.input(&self.image);
                Value::Driven(mean(cx, "average", image, Mean::Geometric, EPSILON, true))
            }
        };
        point(cx, &self.image, shader!("colour/tone_map"))
            .constant("OPERATOR", self.operator as i32)
            .param("average", average)
            .driven("key", &self.key)
            .driven("white", &self.white)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let average = match &self.average {
            Some(given) => cx.driven(given),
            None => {
                let pixels = &cx.image(&self.image).pixels;
                let finite = pixels.iter().map(|p| luminance(*p)).filter(|y| y.is_finite());
                let logs: Vec<f64> = finite.map(|y| (f64::from(EPSILON) + y.max(0.0)).ln()).collect();
                (logs.iter().sum::<f64>() / logs.len().max(1) as f64).exp()
            }
        };
        let (key, white) = (cx.driven(&self.key), cx.driven(&self.white));
        map_rgb(cx, &self.image, |c| tone_map(c, average, key, white, self.operator))
    }
}

/// The first half of `ToneMap`: scales the image so that its average luminance becomes `key`: rgb·key/average.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct ScaleLuminance {
    /// The image.
    image: In<Image>,
    /// Its average luminance.
    #[default(Driven::Value(1.0))]
    average: Driven,
    /// What the average becomes.
    #[default(Driven::Value(0.18))]
    key: Driven,
}

pub(super) const SCALE_LUMINANCE: Kind = Kind::of::<ScaleLuminance>(
    "ScaleLuminance",
    Category::Colour,
    &[r#"ScaleLuminance(image: "in", average: "scalar")"#, r#"ScaleLuminance(image: "grey", average: 0.4, key: 0.2)"#],
);

impl Node for ScaleLuminance {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/scale_luminance")).driven("average", &self.average).driven("key", &self.key).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let scale = cx.driven(&self.key) / cx.driven(&self.average).max(LEAST_AVERAGE);
        map_rgb(cx, &self.image, |c| c.map(|v| v * scale))
    }
}

/// The second half of `ToneMap`: compresses luminance by Reinhard's curve, D = Y(1 + Y/white²)/(1 + Y); colour is scaled
/// by D/Y, 0 where Y = 0.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct ReinhardCurve {
    /// The image, already scaled.
    image: In<Image>,
    /// Smallest luminance that is mapped to 1.
    #[default(Driven::Value(4.0))]
    #[schemars(range(min = 1e-3))]
    white: Driven,
}

pub(super) const REINHARD_CURVE: Kind = Kind::of::<ReinhardCurve>(
    "ReinhardCurve",
    Category::Colour,
    &[r#"ReinhardCurve(image: "in")"#, r#"ReinhardCurve(image: "in", white: "scalar")"#, r#"ReinhardCurve(image: "grey", white: 2)"#],
)
.tolerance(2e-6, 2e-5);

impl Node for ReinhardCurve {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        same(inputs, &self.image)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        point(cx, &self.image, shader!("colour/tone_map"))
            .constant("OPERATOR", Operator::Reinhard as i32)
            .param("average", 1.0)
            .param("key", 1.0)
            .driven("white", &self.white)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let white = cx.driven(&self.white);
        map_rgb(cx, &self.image, |c| tone_map(c, 1.0, 1.0, white, Operator::Reinhard))
    }
}
