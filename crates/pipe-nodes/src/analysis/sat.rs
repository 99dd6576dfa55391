//! `Sat`: the summed-area table of an image.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::summed_area::{Term, Way, table, table_reference};

/// The summed-area table: each pixel becomes the sum of all pixels above and to the left, its own row and column
/// included. The sum over any rectangle then takes four reads (`BoxFromSat`).
///
/// Sums are 32-bit floats in the channels of the input, within 1e-5 of the true sum of positive values at 8192².
/// A value that is NaN or infinite counts as 0: it would fill everything below and to the right.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Sat {
    /// The image to sum.
    image: In<Image>,
    /// How many pixels a step adds, with `method: Steps`: log_radix(width) + log_radix(height) passes.
    #[default = 2]
    #[schemars(range(min = 2, max = 256))]
    radix: u32,
    /// `Scan` sums lines and tiles and carries between them, at about the speed of two copies. `Steps` doubles (or
    /// multiplies by `radix`) the length of the sums from pass to pass. `Auto` is `Scan` for radix 2, whose sums
    /// are the same, and `Steps` for any other.
    method: Method,
}

/// How the sums are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
enum Method {
    /// `Scan` unless a radix is asked for.
    #[default]
    Auto,
    /// Lines or tiles with carries.
    Scan,
    /// Passes of `radix` pixels.
    Steps,
}

pub(crate) const KIND: Kind = Kind::of::<Sat>(
    "Sat",
    Category::Analysis,
    &[
        r#"Sat(image: "in")"#,
        r#"Sat(image: "grey")"#,
        r#"Sat(image: "pair")"#,
        r#"Sat(image: "in", method: Steps)"#,
        r#"Sat(image: "grey", radix: 16)"#,
        r#"Sat(image: "pair", radix: 5, method: Scan)"#,
    ],
)
// Values of both signs cancel in sums; those of one sign keep their digits.
.tolerance(1e-3, 1e-5)
.ports(&[("out", "the table, as large as the image")]);

impl Node for Sat {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let image = inputs.image(&self.image);
        Ok(Output::out(EdgeType::image(image.size, image.channels)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let image = cx.input(&self.image);
        let sums = table(cx, "sat", image, self.way(), Term::Value);
        cx.emit("out", sums);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        vec![Tensor::Image(table_reference(cx.image(&self.image)))]
    }
}

impl Sat {
    const fn way(&self) -> Way {
        match (self.method, self.radix) {
            (Method::Auto, 2) | (Method::Scan, _) => Way::Scan,
            (Method::Auto | Method::Steps, radix) => Way::Steps(radix),
        }
    }
}
