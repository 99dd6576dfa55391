//! `Readback`: a value on its way to a file and to `--stats`.

use pipe_graph::prelude::*;
use pipe_graph::rim::{self, PixelForm};

use crate::shader;

/// Brings a value back from the GPU and writes it to a file.
///
/// The ending of the path says the format: `json`, `csv` or `npy`; for a Table also `svg` or `png`, a plot. The path
/// is relative to the working directory. As JSON, and in `--stats` under this node's name, a Scalar is the array of
/// its components, a Table the array of its entries, an image region rows of pixels.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Readback {
    /// What to read: a Table, a Scalar or an Image.
    source: In<Any>,
    /// The file to write; `--stats` alone when absent. With `--frames`, `####` or `%04d` stands for the frame.
    path: String,
    /// Of an image: x, y, width and height of the region, in pixels; all of it when absent.
    region: Option<[u32; 4]>,
    /// Of an image: the channels to write, such as `"rgb"` or `"a"`; all when absent.
    channels: Option<String>,
    /// Type of the values in an npy file; U32 for tables of counts and F32 otherwise when absent. U8 and U16 hold 0..1 in
    /// their whole range, or counts as they are; integers are rounded, and clamped to the type.
    r#type: Option<FileElement>,
}

pub(super) const KIND: Kind = Kind::of::<Readback>(
    "Readback",
    Category::Structure,
    &[
        r#"Readback(source: "table", path: "histogram.csv")"#,
        r#"Readback(source: "in", path: "corner.json", region: (0, 0, 1, 1), channels: "rgb")"#,
    ],
)
.ports(&[]);

impl Readback {
    /// The region, inside the image.
    fn region_of(&self, t: ImageType) -> Result<[u32; 4], Mistake> {
        let [x, y, w, h] = self.region.unwrap_or([0, 0, t.size[0], t.size[1]]);
        let fits = |at: u32, n: u32, of: u32| n > 0 && at.checked_add(n).is_some_and(|end| end <= of);
        if fits(x, w, t.size[0]) && fits(y, h, t.size[1]) {
            Ok([x, y, w, h])
        } else {
            Err(Mistake::in_field("region", format!("does not lie in the image of {}x{}", t.size[0], t.size[1]))
                .hint("expected (x, y, width, height) in pixels"))
        }
    }

    fn picked(&self) -> Result<Vec<usize>, Mistake> {
        let names = self.channels.as_deref().unwrap_or_default().to_lowercase();
        names
            .chars()
            .map(|c| {
                "rgba"
                    .find(c)
                    .ok_or_else(|| Mistake::in_field("channels", format!("has no meaning for `{c}`")).hint("expected some of r g b a"))
            })
            .collect()
    }
}

impl Node for Readback {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        self.picked()?;
        let known = ["json", "csv", "npy", "svg", "png"];
        let ending = self.path.rsplit_once('.').map_or("", |(_, e)| e).to_lowercase();
        if !self.path.is_empty() && !known.contains(&ending.as_str()) {
            return Err(Mistake::in_field("path", format!("ends in `.{ending}`, which is no format of a readback"))
                .hint(format!("expected one of {}", known.join(", "))));
        }
        Ok(())
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let plot = [".svg", ".png"].iter().any(|e| self.path.to_lowercase().ends_with(e));
        match inputs.ty(self.source.edge) {
            EdgeType::Image(t) => drop(self.region_of(t)?),
            EdgeType::Table(_) => return Ok(Vec::new()),
            EdgeType::Scalar(_) => {}
            EdgeType::Volume(_) | EdgeType::Mesh(_) => {
                return Err(Mistake::in_field("source", "cannot be written by a Readback").hint("name it in `outputs`"));
            }
        }
        if plot {
            return Err(Mistake::in_field("path", "asks for a plot, which only a Table has"));
        }
        Ok(Vec::new())
    }

    fn readback(&self, types: &[EdgeType]) -> Option<ReadbackFile> {
        let ty = match *types.first()? {
            EdgeType::Image(t) => {
                let [_, _, w, h] = self.region_of(t).ok()?;
                EdgeType::Image(t.with_size([w, h]))
            }
            other => other,
        };
        let channels = self.picked().unwrap_or_default();
        Some(ReadbackFile { path: self.path.clone(), element: self.r#type, channels, ty })
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let source = cx.input(&self.source);
        let name = cx.name().to_owned();
        let EdgeType::Image(t) = cx.ty(self.source.edge) else {
            rim::fetch_words(cx, &name, source);
            return Ok(());
        };
        let [x, y, w, h] = self.region_of(t)?;
        let region = if [w, h] == t.size {
            source
        } else {
            let region = cx.intermediate("region", Shape::image([w, h], t.channels));
            cx.pass("region", shader!("structure/region"))
                .read("image", source, Reach::Whole)
                .write("out", region)
                .param("origin", [x as i32, y as i32])
                .add();
            region
        };
        rim::fetch_image(cx, &name, region, &PixelForm::linear([w, h], t.channels));
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        Vec::new()
    }
}
