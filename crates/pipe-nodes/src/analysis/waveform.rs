//! `Waveform`: the values of every column of an image.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::bins::{Binning, Channel, Outside, UNIT, check_range};
use super::scope::{Layout, Scope};
use crate::shader;

/// The waveform monitor: above each column of the image, how often which value occurs in it, low values at the
/// bottom. Brightness is log(1 + n)/log(1 + largest n). Values are shown as they are: put a `Colorspace` in front
/// to see the encoded signal. Values outside the range are not shown.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Waveform {
    /// The image to measure.
    image: In<Image>,
    /// `Luminance`: one trace, 1 channel. `Rgb`: three traces above each other in their colours. `Parade`: three
    /// traces side by side.
    mode: Mode,
    /// How many levels are told apart: the height of the picture.
    #[default = 256]
    #[schemars(range(min = 2, max = 4096), extend("x-unit" = "px"))]
    levels: u32,
    /// How many columns a trace has. As many as the image, but at most 1024, when absent.
    #[schemars(range(min = 1, max = 4096), extend("x-unit" = "px"))]
    columns: Option<u32>,
    /// The values at the bottom and at the top, `(lo, hi)`.
    #[default(UNIT)]
    range: (f32, f32),
}

/// What is traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
enum Mode {
    /// The luminance.
    #[default]
    Luminance,
    /// Red, green and blue above each other.
    Rgb,
    /// Red, green and blue side by side.
    Parade,
}

pub(crate) const KIND: Kind = Kind::of::<Waveform>(
    "Waveform",
    Category::Analysis,
    &[
        r#"Waveform(image: "in")"#,
        r#"Waveform(image: "in", mode: Rgb, levels: 64, columns: 40)"#,
        r#"Waveform(image: "in", mode: Parade, levels: 32, range: (-0.5, 3.3))"#,
        r#"Waveform(image: "grey", columns: 100)"#,
    ],
)
.ports(&[("out", "the picture: 1 channel for `Luminance`, else RGBA")]);

impl Node for Waveform {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        check_range(self.range)
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let width = inputs.image(&self.image).size[0];
        Ok(Output::out(EdgeType::Image(self.scope(width).image())))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (image, out) = (cx.input(&self.image), cx.output("out"));
        let scope = self.scope(cx.image_of(image).size[0]);
        let counts = cx.intermediate("counts", Shape::uints(scope.cells()));
        let pass = cx
            .pass("counts", shader!("analysis/waveform"))
            .entry(Entry::Each)
            .read("image", image, Reach::Point)
            .write_as("counts", counts, Access::Atomic, None)
            .constant("COLUMNS", scope.width)
            .constant("PANELS", scope.panels() as i32)
            .grid(Grid::Blocks([1, 1]));
        self.binning(Channel::Luminance).describe(pass).add();
        scope.show(cx, counts, out);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let image = cx.image(&self.image);
        let [low, high] = [self.range.0, self.range.1].map(f64::from);
        let scope = self.scope(image.size[0]);
        let channels = match self.mode {
            Mode::Luminance => vec![Channel::Luminance],
            Mode::Rgb | Mode::Parade => vec![Channel::R, Channel::G, Channel::B],
        };
        let mut counts = vec![0; scope.cells() as usize];
        for (i, pixel) in image.pixels.iter().enumerate() {
            let x = i as u64 % u64::from(image.size[0]);
            let column = (x * u64::from(scope.width) / u64::from(image.size[0])) as usize;
            for (panel, channel) in channels.iter().enumerate() {
                if let Some(level) = self.binning(*channel).bin(channel.of(*pixel), low, high) {
                    counts[(panel * scope.height as usize + level) * scope.width as usize + column] += 1;
                }
            }
        }
        vec![Tensor::Image(scope.show_reference(&counts))]
    }
}

impl Waveform {
    fn scope(&self, width: u32) -> Scope {
        let layout = match self.mode {
            Mode::Luminance => Layout::Grey,
            Mode::Rgb => Layout::Overlay,
            Mode::Parade => Layout::Parade,
        };
        Scope { width: self.columns.unwrap_or(width.min(1024)), height: self.levels, layout }
    }

    fn binning(&self, channel: Channel) -> Binning {
        Binning { bins: self.levels, low: self.range.0.into(), high: self.range.1.into(), channel, outside: Outside::Ignore }
    }
}
