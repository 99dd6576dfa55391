//! `ReadImage`, `ReadVolume` and `ReadTable`: files as sources.

use pipe_graph::prelude::*;
use pipe_graph::reference::Block;

use crate::shader;

/// An image file, converted to working space like a graph input; `file.exr#layer` names a layer. NPY arrays are numbers, not
/// pictures: they are linear unless `--in-colorspace` says otherwise, with 8 and 16 bits for 0..1.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct ReadImage {
    /// Path, relative to the graph file.
    path: String,
    #[serde(skip)]
    found: Option<(String, ImageType)>,
}

pub(super) const READ_IMAGE: Kind = Kind::of::<ReadImage>("ReadImage", Category::Sources, &[]);

impl Node for ReadImage {
    fn open(&mut self, cx: &Opening<'_>) -> Result<(), Mistake> {
        let path = cx.folder.join(&self.path);
        let ty = cx.loader.image(&path).map_err(|reason| Mistake::in_field("path", format!("cannot be read: {reason}")))?;
        self.found = Some((path.to_string_lossy().into_owned(), ty));
        Ok(())
    }

    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let (_, ty) = self.found.as_ref().ok_or_else(|| Mistake::new("was not opened"))?;
        Ok(Output::out(EdgeType::Image(*ty)))
    }

    fn file(&self) -> Option<FileSource> {
        self.found.as_ref().map(|(path, _)| FileSource::Image(path.clone()))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let file = cx.file();
        cx.emit("out", file);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        cx.file.cloned().into_iter().collect()
    }
}

/// A volume file: NRRD, NIfTI, NPY, or raw voxels as `file.raw#181x217x181:u8`. Whole numbers of 8 and 16 unsigned bits stand
/// for 0..1 unless the file scales them; other numbers stand for themselves.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct ReadVolume {
    /// Path, relative to the graph file. `file.nii#3` is a point in time of a series.
    path: String,
    /// Values that become 0 and 1, `(low, high)`; what lies outside is clamped. A window of a CT, say, in Hounsfield units.
    window: Option<(f32, f32)>,
    #[serde(skip)]
    found: Option<(String, VolumeType)>,
}

pub(super) const READ_VOLUME: Kind = Kind::of::<ReadVolume>("ReadVolume", Category::Sources, &[]);

impl Node for ReadVolume {
    fn open(&mut self, cx: &Opening<'_>) -> Result<(), Mistake> {
        let path = cx.folder.join(&self.path);
        let ty = cx.loader.volume(&path).map_err(|reason| Mistake::in_field("path", format!("cannot be read: {reason}")))?;
        self.found = Some((path.to_string_lossy().into_owned(), ty));
        Ok(())
    }

    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let (_, ty) = self.found.as_ref().ok_or_else(|| Mistake::new("was not opened"))?;
        if self.window.is_some_and(|(low, high)| low >= high) {
            return Err(Mistake::in_field("window", "holds nothing").hint("give the smaller value first: `window: (-100, 300)`"));
        }
        Ok(Output::out(EdgeType::Volume(*ty)))
    }

    fn file(&self) -> Option<FileSource> {
        self.found.as_ref().map(|(path, _)| FileSource::Volume(path.clone()))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let file = cx.file();
        let Some((low, high)) = self.window else {
            cx.emit("out", file);
            return Ok(());
        };
        let out = cx.output("out");
        cx.pass("", shader!("sources/window"))
            .read("file", file, Reach::Point)
            .write("out", out)
            .param("low", low)
            .param("high", high)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let windowed = |file: &Tensor| match (file, self.window) {
            (Tensor::Volume(block), Some((low, high))) => {
                let [low, high] = [low, high].map(f64::from);
                let voxels = block.voxels.iter().map(|v| v.map(|v| ((v - low) / (high - low)).clamp(0.0, 1.0))).collect();
                Tensor::Volume(Block { voxels, ..block.clone() })
            }
            _ => file.clone(),
        };
        cx.file.map(windowed).into_iter().collect()
    }
}

/// A table file: csv, json or npy.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct ReadTable {
    /// Path, relative to the graph file.
    path: String,
    #[serde(skip)]
    found: Option<TableFile>,
}

pub(super) const READ_TABLE: Kind = Kind::of::<ReadTable>("ReadTable", Category::Sources, &[]);

impl Node for ReadTable {
    fn open(&mut self, cx: &Opening<'_>) -> Result<(), Mistake> {
        let path = cx.folder.join(&self.path);
        let table = cx.loader.table(&path).map_err(|reason| Mistake::in_field("path", format!("cannot be read: {reason}")))?;
        self.found = Some(table);
        Ok(())
    }

    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(match &self.found {
            Some(TableFile::F32(v)) => EdgeType::table(v.len() as u32, Element::F32),
            Some(TableFile::U32(v)) => EdgeType::table(v.len() as u32, Element::U32),
            None => return Err(Mistake::new("was not opened")),
        }))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let table = match &self.found {
            Some(TableFile::F32(v)) => cx.floats("file", v),
            Some(TableFile::U32(v)) => cx.uints("file", v),
            None => return Err(Mistake::new("was not opened")),
        };
        cx.emit("out", table);
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        vec![Tensor::Table(match &self.found {
            Some(TableFile::F32(v)) => v.iter().map(|v| f64::from(*v)).collect(),
            Some(TableFile::U32(v)) => v.iter().map(|v| f64::from(*v)).collect(),
            None => Vec::new(),
        })]
    }
}
