//! `Vectorscope`: the hues and saturations of an image.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::reduction::grey;
use super::scope::{Layout, Scope};
use crate::shader;

/// The vectorscope: how often which chroma occurs, Cb to the right and Cr upwards, grey in the middle, hue around
/// it and saturation outwards. Each cell shows the colour that it stands for, as bright as log(1 + n)/log(1 + largest n).
///
/// Cb = (B − Y)/1.8556 and Cr = (R − Y)/1.5748 (ITU-R BT.709-6), each from −0.5 to 0.5, of values as they are: put a
/// `Colorspace` in front to see the encoded signal. Chroma outside is not shown.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Vectorscope {
    /// The image to measure.
    image: In<Image>,
    /// Width and height of the picture.
    #[default = 256]
    #[schemars(range(min = 2, max = 4096), extend("x-unit" = "px"))]
    size: u32,
    /// Magnification: 4 shows chroma from −0.125 to 0.125.
    #[default = 1.0]
    #[schemars(range(min = 0.01, max = 100.0))]
    zoom: f32,
}

pub(crate) const KIND: Kind = Kind::of::<Vectorscope>(
    "Vectorscope",
    Category::Analysis,
    &[r#"Vectorscope(image: "in")"#, r#"Vectorscope(image: "in", size: 65, zoom: 0.3)"#, r#"Vectorscope(image: "grey", size: 32)"#],
)
.ports(&[("out", "the picture, RGBA")]);

impl Node for Vectorscope {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Image(self.scope().image())))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let counts = cx.intermediate("counts", Shape::uints(self.scope().cells()));
        cx.pass("counts", shader!("analysis/vectorscope"))
            .entry(Entry::Each)
            .read("image", image, Reach::Point)
            .write_as("counts", counts, Access::Atomic, None)
            .constant("SIZE", self.size as i32)
            .param("extent", self.extent())
            .grid(Grid::Blocks([1, 1]))
            .add();
        self.scope().show(cx, counts, out);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let extent = f64::from(self.extent());
        let size = f64::from(self.size);
        let mut counts = vec![0; self.scope().cells() as usize];
        for pixel in &cx.image(&self.image).pixels {
            let y = grey(*pixel);
            let chroma = [(pixel[2] - y) / 1.8556, (pixel[0] - y) / 1.5748];
            if chroma.iter().all(|v| (-extent..=extent).contains(v)) {
                let [x, y] = chroma.map(|v| (((v + extent) / (2.0 * extent) * size).floor() as usize).min(self.size as usize - 1));
                counts[y * self.size as usize + x] += 1;
            }
        }
        vec![Tensor::Image(self.scope().show_reference(&counts))]
    }
}

impl Vectorscope {
    const fn scope(&self) -> Scope {
        Scope { width: self.size, height: self.size, layout: Layout::Chroma }
    }

    /// The chroma at the edge.
    fn extent(&self) -> f32 {
        0.5 / self.zoom
    }
}
