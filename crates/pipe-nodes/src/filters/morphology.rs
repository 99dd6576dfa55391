//! `Dilate`, `Erode`, `Open`, `Close`: grey-scale morphology with flat elements.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::filters::structuring_element::Extreme::{Largest, Smallest};
use crate::filters::structuring_element::{Element, Extreme, morph, morph_reference};

macro_rules! node {
    ($node:ident, $kind:ident, $doc:literal, $passes:expr) => {
        #[doc = $doc]
        ///
        /// Every channel by itself, alpha too; a NaN fills the element around it.
        #[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
        #[serde(default)]
        pub(super) struct $node {
            /// The image.
            image: In<Image>,
            /// Pixels to either side; 0 copies.
            #[default = 1]
            #[schemars(range(min = 0, max = 1024), extend("x-unit" = "px"))]
            radius: u32,
            /// The neighbourhood: `Square` of side 2r + 1, or `Disk`, x² + y² ≤ r². Squares cost little at any radius,
            /// disks as much as their height.
            shape: Element,
        }

        pub(super) const $kind: Kind = Kind::of::<$node>(
            stringify!($node),
            Category::Filters,
            &[
                concat!(stringify!($node), r#"(image: "in")"#),
                concat!(stringify!($node), r#"(image: "in", radius: 2, shape: Disk)"#),
                concat!(stringify!($node), r#"(image: "pair", radius: 7)"#),
                concat!(stringify!($node), r#"(image: "grey", radius: 9, shape: Disk)"#),
                concat!(stringify!($node), r#"(image: "grey", radius: 40)"#),
                concat!(stringify!($node), r#"(image: "in", radius: 0)"#),
            ],
        )
        .tolerance(0.0, 0.0);

        impl Node for $node {
            fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
                Ok(Output::out(EdgeType::Image(inputs.image(&self.image))))
            }

            fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
                let (image, out) = (cx.input(&self.image), cx.output("out"));
                declare(cx, &$passes, (self.shape, self.radius), image, out);
                Ok(())
            }

            fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
                let step = |image: Raster, taken: &Extreme| morph_reference(&image, *taken, (self.shape, self.radius), cx.border);
                vec![Tensor::Image($passes.iter().fold(cx.image(&self.image).clone(), step))]
            }
        }
    };
}

/// One extreme after the other.
fn declare(cx: &mut Lowering<'_>, passes: &[Extreme], element: (Element, u32), image: ResourceId, out: ResourceId) {
    let shape = cx.shape(out);
    let mut from = image;
    for (i, taken) in passes.iter().enumerate() {
        let name = match taken {
            Largest => "dilated",
            Smallest => "eroded",
        };
        let to = if i + 1 == passes.len() { out } else { cx.intermediate(name, shape) };
        morph(cx, &format!("{name}."), *taken, element, from, to);
        from = to;
    }
}

node!(Dilate, DILATE, "The largest value of a neighbourhood: what is bright grows.", [Largest]);
node!(Erode, ERODE, "The smallest value of a neighbourhood: what is dark grows.", [Smallest]);
node!(Open, OPEN, "Erodes, then dilates: takes away what is bright and smaller than the neighbourhood.", [Smallest, Largest]);
node!(Close, CLOSE, "Dilates, then erodes: fills what is dark and smaller than the neighbourhood.", [Largest, Smallest]);
