//! What the scopes share: pictures of how often something occurs.
//!
//! A scope counts pixels into the cells of one or three panels, exactly, and shows each cell by the logarithm of
//! its count, so that a single pixel is seen beside a million: log(1 + n)/log(1 + largest n). The picture's rows go
//! up: the lowest value stands in the lowest row.

use pipe_graph::prelude::*;

use crate::shader;

/// How the panels of a scope make a picture; the constant `LAYOUT` of the shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Layout {
    /// One panel, in white.
    Grey = 0,
    /// Three panels above each other, in red, green and blue.
    Overlay = 1,
    /// Three panels side by side, in red, green and blue.
    Parade = 2,
    /// One panel, each cell in the colour of the chroma that it stands for.
    Chroma = 3,
}

/// The cells of a scope.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Scope {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) layout: Layout,
}

impl Scope {
    /// How many panels are counted.
    pub(crate) const fn panels(&self) -> u32 {
        match self.layout {
            Layout::Grey | Layout::Chroma => 1,
            Layout::Overlay | Layout::Parade => 3,
        }
    }

    /// Cells of all panels: panel after panel, row after row from the lowest value, then along x.
    pub(crate) const fn cells(&self) -> u32 {
        self.panels() * self.width * self.height
    }

    /// The picture.
    pub(crate) const fn image(&self) -> ImageType {
        match self.layout {
            Layout::Grey => ImageType::new([self.width, self.height], 1),
            Layout::Overlay | Layout::Chroma => ImageType::new([self.width, self.height], 4),
            Layout::Parade => ImageType::new([3 * self.width, self.height], 4),
        }
    }

    /// Counts → picture.
    pub(crate) fn show(&self, cx: &mut Lowering<'_>, counts: ResourceId, out: ResourceId) {
        let largest = cx.intermediate("largest", Shape::uints(1));
        cx.pass("largest", shader!("analysis/table_largest"))
            .entry(Entry::Kernel)
            .read("table", counts, Reach::Whole)
            .write_as("out", largest, Access::Atomic, None)
            .grid(Grid::Groups([self.cells().div_ceil(4096), 1, 1]))
            .add();
        cx.pass("", shader!("analysis/scope"))
            .entry(Entry::At)
            .read("counts", counts, Reach::Whole)
            .read("largest", largest, Reach::Whole)
            .write("out", out)
            .constant("WIDTH", self.width as i32)
            .constant("HEIGHT", self.height as i32)
            .constant("LAYOUT", self.layout as i32)
            .add();
    }

    /// The twin of [`Scope::show`].
    pub(crate) fn show_reference(&self, counts: &[u64]) -> Raster {
        let largest = counts.iter().copied().max().unwrap_or(0);
        let [w, h] = [i64::from(self.width), i64::from(self.height)];
        let shown = |panel: i64, x: i64, y: i64| {
            let n = counts[((panel * h + (h - 1 - y)) * w + x) as usize];
            if largest == 0 { 0.0 } else { (n as f64).ln_1p() / (largest as f64).ln_1p() }
        };
        let image = self.image();
        Raster::from_fn(image.size, image.channels, |x, y| match self.layout {
            Layout::Grey => [shown(0, x, y); 4],
            Layout::Overlay => [shown(0, x, y), shown(1, x, y), shown(2, x, y), 1.0],
            Layout::Parade => {
                let mut c = [0.0, 0.0, 0.0, 1.0];
                c[(x / w) as usize] = shown(x / w, x % w, y);
                c
            }
            Layout::Chroma => {
                let cb = (x as f64 + 0.5) / w as f64 - 0.5;
                let cr = (h as f64 - 1.0 - y as f64 + 0.5) / h as f64 - 0.5;
                let n = shown(0, x, y);
                let [r, g, b] = chroma_colour(cb, cr);
                [r * n, g * n, b * n, 1.0]
            }
        })
    }
}

/// The colour of half luminance and this chroma (ITU-R BT.709-6, the inverse of its colour difference), clipped.
fn chroma_colour(cb: f64, cr: f64) -> [f64; 3] {
    let r = 0.5 + 1.5748 * cr;
    let b = 0.5 + 1.8556 * cb;
    let g = (0.5 - 0.2126 * r - 0.0722 * b) / 0.7152;
    [r, g, b].map(|v| v.clamp(0.0, 1.0))
}
