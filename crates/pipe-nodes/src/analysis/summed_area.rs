//! Summed-area tables: the sum of all pixels above and to the left of each one, itself included (Crow 1984).
//!
//! Three ways to the same table. *Steps*: log_r w passes along x, then log_r h along y, each adding r pixels
//! (Hensley et al., Fast Summed-Area Table Generation, 2005); the textbook's. *Tiles*, for GPUs: the sums of the
//! rows and columns of every tile, carried across tiles by two small passes, then the tiles themselves with those
//! carries: the image is read twice and written once, and no workgroup waits for another (Nehab et al.,
//! GPU-Efficient Recursive Filtering and Summed-Area Tables, 2011), which is also the way of images that do not fit
//! whole. *Lines*, for CPUs: one thread a row, then one a column.
//!
//! Carries are compensated: a table of 8192² is within 1e-5 of the true sums although 2²⁶ floats add up in it,
//! where a plain running sum is off by percents. A value that is not finite counts as 0, lest it fill the table.

use pipe_graph::prelude::*;

use super::reduction::extended;
use crate::shader;

/// How a table is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    /// Whatever is fastest on the device.
    Scan,
    /// Passes that add this many pixels each.
    Steps(u32),
}

/// What is summed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Term {
    /// The value.
    Value,
    /// log(ε + max(v, 0))
    Log {
        /// ε
        epsilon: f32,
    },
}

/// The summed-area table of an image: 32-bit floats, as many channels.
pub(crate) fn table(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, way: Way, term: Term) -> ResourceId {
    let image = ready(cx, suffix, image, term);
    let ty = cx.image_of(image);
    let build = Build { suffix, size: ty.size, channels: ty.channels };
    let tiles = cx.limits().profile == Profile::Gpu || cx.limits().tiled;
    match way {
        Way::Steps(radix) => build.steps(cx, image, radix),
        Way::Scan if tiles && build.carry_bytes() <= cx.limits().max_binding_bytes => build.tiles(cx, image),
        Way::Scan => build.lines(cx, image),
    }
}

/// The twin.
pub(crate) fn table_reference(image: &Raster) -> Raster {
    let mut sums = image.clone();
    let width = image.size[0] as usize;
    for i in 0..sums.pixels.len() {
        let (x, y) = (i % width, i / width);
        let at = |dx: usize, dy: usize| if x < dx || y < dy { [0.0; 4] } else { sums.pixels[i - dy * width - dx] };
        let (left, above, corner) = (at(1, 0), at(0, 1), at(1, 1));
        let value = |c: usize| if image.pixels[i][c].is_finite() { image.pixels[i][c] } else { 0.0 };
        sums.pixels[i] = narrow(std::array::from_fn(|c| value(c) + left[c] + above[c] - corner[c]), image.channels);
    }
    sums
}

/// The terms as an image: what is not finite becomes 0. A point pass, so that it may be fused into what reads it.
fn ready(cx: &mut Lowering<'_>, suffix: &str, image: ResourceId, term: Term) -> ResourceId {
    let ty = cx.image_of(image);
    let name = format!("{suffix}.terms");
    let out = cx.intermediate(&name, Shape::image(ty.size, ty.channels));
    let (logarithm, epsilon) = match term {
        Term::Value => (false, 0.0),
        Term::Log { epsilon } => (true, epsilon),
    };
    cx.pass(&name, shader!("analysis/sat_terms"))
        .entry(Entry::Point)
        .read("image", image, Reach::Point)
        .write("out", out)
        .constant("LOGARITHM", logarithm)
        .param("epsilon", epsilon)
        .add();
    out
}

/// One table under construction.
struct Build<'a> {
    suffix: &'a str,
    size: [u32; 2],
    channels: u8,
}

impl Build<'_> {
    fn name(&self, part: &str) -> String {
        format!("{}.{part}", self.suffix)
    }

    fn image(&self) -> Shape {
        Shape::image(self.size, self.channels)
    }

    /// log_r w + log_r h passes.
    fn steps(&self, cx: &mut Lowering<'_>, image: ResourceId, radix: u32) -> ResourceId {
        let mut current = image;
        for (axis, name) in ["x", "y"].into_iter().enumerate() {
            let mut stride = 1;
            while stride < self.size[axis] {
                let name = self.name(&format!("{name}{stride}"));
                let next = cx.intermediate(&name, self.image());
                cx.pass(&name, shader!("analysis/sat_step"))
                    .entry(Entry::At)
                    .read("sums", current, Reach::Whole)
                    .write("out", next)
                    .constant("AXIS", axis as i32)
                    .constant("STRIDE", stride as i32)
                    .constant("RADIX", radix.min(self.size[axis].div_ceil(stride)) as i32)
                    .add();
                current = next;
                stride = stride.saturating_mul(radix);
            }
        }
        current
    }

    /// One thread a row, one thread a column.
    fn lines(&self, cx: &mut Lowering<'_>, image: ResourceId) -> ResourceId {
        let mut current = image;
        for (axis, name) in ["rows", "columns"].into_iter().enumerate() {
            let name = self.name(name);
            let next = cx.intermediate(&name, self.image());
            cx.pass(&name, extended(&shader!("analysis/sat_lines"), &self.texels(&[], &[])))
                .entry(Entry::Kernel)
                .read_once("sums", current)
                .write("out", next)
                .constant("AXIS", axis as i32)
                .grid(Grid::Groups([self.size[1 - axis].div_ceil(64), 1, 1]))
                .add();
            current = next;
        }
        current
    }

    /// Tiles that fill the 16 KiB of workgroup memory that every device has.
    const fn side(&self) -> u32 {
        if self.channels == 1 { 64 } else { 32 }
    }

    fn grid(&self) -> [u32; 2] {
        self.size.map(|n| n.div_ceil(self.side()))
    }

    /// Bytes of the larger table of carries.
    fn carry_bytes(&self) -> u64 {
        let [w, h] = self.size.map(u64::from);
        let [across, down] = self.grid().map(u64::from);
        (across * h).max(down * w) * u64::from(self.channels) * 4
    }

    /// Tile sums, carries, tiles.
    fn tiles(&self, cx: &mut Lowering<'_>, image: ResourceId) -> ResourceId {
        let [across, down] = self.grid();
        let [w, h] = self.size;
        let channels = u32::from(self.channels);
        // The sum of each row of a tile, tile column after tile column; of each column, tile row after tile row.
        let mut carries = |name: &str, len: u32| cx.intermediate(&self.name(name), Shape::floats(len * channels));
        let rows = carries("rows", across * h);
        let columns = carries("columns", down * w);
        let left = carries("left", across * h);
        let above = carries("above", down * w);
        let edges = carries("edges", down * w);
        let grid = Grid::Blocks([self.side(); 2]);
        let side = self.side() as i32;
        let shader = shader!("analysis/sat_tile_sums");
        cx.pass(&self.name("sums"), extended(&shader, &self.texels(&[], &["rows", "columns"])))
            .entry(Entry::Kernel)
            .read_once("image", image)
            .write("rows", rows)
            .write("columns", columns)
            .constant("SIDE", side)
            .grid(grid)
            .add();
        for (name, sums, carried, len, count) in [("left", rows, left, h, across), ("above", columns, above, w, down)] {
            let shader = shader!("analysis/sat_carry");
            cx.pass(&self.name(name), extended(&shader, &self.texels(&["sums"], &["carried"])))
                .entry(Entry::Kernel)
                .read("sums", sums, Reach::Whole)
                .write("carried", carried)
                .constant("LENGTH", len as i32)
                .constant("COUNT", count as i32)
                .grid(Grid::Groups([len.div_ceil(64), 1, 1]))
                .add();
        }
        let shader = shader!("analysis/sat_edges");
        cx.pass(&self.name("edges"), extended(&shader, &self.texels(&["above"], &["edges"])))
            .entry(Entry::Kernel)
            .read("above", above, Reach::Whole)
            .write("edges", edges)
            .constant("LENGTH", w as i32)
            .grid(Grid::Groups([down, 1, 1]))
            .add();
        let out = cx.intermediate(&self.name("table"), self.image());
        let shader = shader!("analysis/sat_tiles");
        cx.pass(&self.name("table"), extended(&shader, &self.texels(&["left", "edges"], &[])))
            .entry(Entry::Kernel)
            .read_once("image", image)
            .read("left", left, Reach::Whole)
            .read("edges", edges, Reach::Whole)
            .write("out", out)
            .constant("SIDE", side)
            .grid(grid)
            .add();
        out
    }

    /// The type of a pixel's sums, and how tables of floats hold them: `NAME_at(i)` and `put_NAME(i, t)`.
    fn texels(&self, reads: &[&str], writes: &[&str]) -> String {
        let n = self.channels;
        let (name, narrow, widen) = match n {
            1 => ("f32", "v.x", "vec4f(t, 0.0, 0.0, 0.0)"),
            2 => ("vec2f", "v.xy", "vec4f(t, 0.0, 0.0)"),
            _ => ("vec4f", "v", "t"),
        };
        let mut text = format!(
            "alias Texel = {name};\nfn texel_of(v: vec4f) -> Texel {{ return {narrow}; }}\nfn pixel_of(t: Texel) -> vec4f {{ return {widen}; }}\n\
            fn lost_in(a: Texel, b: Texel) -> Texel {{ return texel_of(package::lib::wide::sum_error(pixel_of(a), pixel_of(b))); }}\n",
        );
        for port in reads {
            let parts: Vec<_> = (0..n).map(|c| format!("load_{port}({n} * i + {c})")).collect();
            text += &format!("fn {port}_at(i: i32) -> Texel {{ return Texel({}); }}\n", parts.join(", "));
        }
        for port in writes {
            let part = |c: u8| if n == 1 { "t".to_owned() } else { format!("t[{c}]") };
            let parts: String = (0..n).map(|c| format!("store_{port}({n} * i + {c}, {}); ", part(c))).collect();
            text += &format!("fn put_{port}(i: i32, t: Texel) {{ {parts}}}\n");
        }
        text
    }
}
