//! The passes at the rim: words to an image, an image to words.
//!
//! A buffer that a shader binds has a largest size, so large pictures cross the rim in bands of rows, each band a
//! resource of its own. The bands of an image on its way in are written one after the other into the same storage.

use std::ops::Range;

use super::{Alpha, Layout, PixelForm, Sample, Transfer, Voxel, VoxelForm};
use crate::lowering::{Lowering, PassBuilder};
use crate::pass::{Access, Entry, Fetch, Grid, Limits, Origin, Reach, Resource, ResourceId, Shader, Shape, Values};
use crate::types::{ImageType, Precision, VolumeType};

macro_rules! shader {
    ($path:literal, $tail:expr) => {
        Shader::builtin(
            concat!($path, ".wgsl"),
            &format!("{}\n{}", include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/", $path, ".wgsl")), $tail),
        )
    };
}

/// Rows of a picture that cross the rim together, and the words that each of its planes takes.
struct Band {
    rows: Range<u32>,
    /// Byte range of each plane's part, in the whole picture.
    planes: Vec<Range<u64>>,
}

impl Band {
    /// What each of its planes takes.
    fn shape(&self, form: &PixelForm) -> Shape {
        let samples = if form.layout == Layout::Planar { 1 } else { u32::from(form.channels) };
        Shape::Pixels { size: [form.size[0], self.rows.end - self.rows.start], pixel: samples * form.sample.bytes() as u32 }
    }
}

/// Bands of at most as many bytes a plane as a shader can bind; one where the planner cuts tiles. They begin at multiples
/// of 4 rows, so that they begin at whole words.
fn bands(form: &PixelForm, limits: &Limits) -> Vec<Band> {
    let [w, h] = form.size.map(u64::from);
    let most = if limits.tiled { u64::MAX } else { limits.max_binding_bytes };
    let planes = if form.layout == Layout::Planar { u64::from(form.channels) } else { 1 };
    let row = form.bytes() / h / planes;
    let rows = (most / row.max(1) / 4 * 4).clamp(4, h.max(4));
    let plane = w * h * form.sample.bytes();
    let mut bands = Vec::new();
    let mut first = 0;
    while first < h {
        let end = (first + rows).min(h);
        let part = |p: u64| if planes == 1 { first * row..end * row } else { p * plane + first * row..p * plane + end * row };
        bands.push(Band { rows: first as u32..end as u32, planes: (0..planes).map(part).collect() });
        first = end;
    }
    bands
}

fn words(range: &Range<u64>) -> Shape {
    Shape::Words { len: ((range.end - range.start).div_ceil(4)) as u32 }
}

/// Constants and parameters that both directions share.
fn describe<'b, 'a>(pass: PassBuilder<'b, 'a>, form: &PixelForm) -> PassBuilder<'b, 'a> {
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let convert = form.matrix != identity && form.channels >= 3;
    let (transfer, gamma) = match form.transfer {
        Transfer::Linear => (0, 1.0),
        Transfer::Srgb => (1, 1.0),
        Transfer::Gamma(g) => (2, g),
    };
    let mut pass = pass
        .constant("CHANNELS", i32::from(form.channels))
        .constant("BYTES", form.sample.bytes() as i32)
        .constant("FLOATING", matches!(form.sample, Sample::F16 | Sample::F32))
        .constant("TRANSFER", transfer)
        .constant("STRAIGHT", form.alpha == Alpha::Straight)
        .constant("HAS_ALPHA", form.alpha != Alpha::None && matches!(form.channels, 2 | 4))
        .constant("CONVERT", convert)
        .constant("PLANAR", form.layout == Layout::Planar)
        .param("gamma", gamma);
    for (name, row) in ["row0", "row1", "row2"].into_iter().zip(form.matrix) {
        pass = pass.param(name, row);
    }
    pass
}

/// `fn word(c, i)` over the plane ports `c0…`.
fn word_function(planes: usize) -> String {
    let cases: String = (1..planes).map(|c| format!("    if c == {c} {{ return load_c{c}(i); }}\n")).collect();
    format!("fn word(c: i32, i: i32) -> u32 {{\n{cases}    return load_c0(i);\n}}\n")
}

/// The image of the external `name`, whose pixels lie in memory as `form` says. Without conversion to working
/// space it keeps every bit of a float file.
pub fn ingest_image(cx: &mut Lowering<'_>, name: &str, form: &PixelForm) -> ResourceId {
    let shape = Shape::Image(ImageType::new(form.size, form.image_channels()));
    let bands = bands(form, cx.limits());
    let whole = bands.len() == 1;
    let mut image = None;
    for band in bands {
        let mut ports = Vec::new();
        for range in &band.planes {
            let origin = Origin::External { name: name.to_owned(), ranges: vec![range.clone()] };
            ports.push(cx.graph.add(Resource { name: format!("{name}.file"), shape: band.shape(form), origin }));
        }
        let out = cx.graph.add(Resource { name: name.to_owned(), shape, origin: Origin::Pass });
        let tail = if whole {
            "fn apply() -> vec4f { return decode(pixel().x, pixel().y); }"
        } else {
            "fn each(xy: vec2i) { store_out(vec2i(xy.x, FIRST_ROW + xy.y), decode(xy.x, xy.y)); }"
        };
        let pass = cx.pass("decode", shader!("io/ingest", format!("{}{tail}\n", word_function(ports.len()))));
        let values = if form.keeps_halves() { Values::Halves } else { Values::Any };
        let mut pass = describe(pass, form).constant("FIRST_ROW", band.rows.start as i32).values(values);
        for (c, port) in ports.into_iter().enumerate() {
            pass = pass.read(&format!("c{c}"), port, Reach::Point);
        }
        let pass = if whole {
            pass.entry(Entry::Point).write("out", out)
        } else {
            let rows = band.rows.end - band.rows.start;
            pass.entry(Entry::Each).grid(Grid::Elements([form.size[0], rows, 1])).write_as("out", out, Access::Store, image)
        };
        pass.add();
        image = Some(out);
    }
    image.expect("an image has rows")
}

/// Fetches an image as pixels of this form under `name`.
pub fn fetch_image(cx: &mut Lowering<'_>, name: &str, image: ResourceId, form: &PixelForm) {
    let mut parts = Vec::new();
    for band in bands(form, cx.limits()) {
        let outs: Vec<ResourceId> = band.planes.iter().map(|_| cx.intermediate("file", band.shape(form))).collect();
        let cases: String = (1..outs.len()).map(|c| format!("    if c == {c} {{ store_c{c}(i, v); return; }}\n")).collect();
        let put = format!("fn put(c: i32, i: i32, v: u32) {{\n{cases}    store_c0(i, v);\n}}\n");
        let grey = (form.channels == 1 || form.alpha != Alpha::None && form.channels == 2) && cx.image_of(image).channels == 4;
        let pass = cx.pass("encode", shader!("io/pack", put)).entry(Entry::Each);
        let mut pass = describe(pass, form)
            .constant("FIRST_ROW", band.rows.start as i32)
            .constant("GREY", grey)
            .grid(Grid::Pixels(4 / form.sample.bytes() as u32))
            .read("image", image, Reach::Point);
        for (c, out) in outs.iter().enumerate() {
            pass = pass.write(&format!("c{c}"), *out);
        }
        pass.add();
        parts.extend(outs.into_iter().zip(band.planes));
    }
    cx.graph.fetches.push(Fetch { name: name.to_owned(), parts });
}

/// The volume of the external `name`, whose voxels lie in memory as `form` says. Large ones cross the rim in bands of
/// slices, four at a time, so that every band begins at a whole word.
pub fn ingest_volume(cx: &mut Lowering<'_>, name: &str, form: &VoxelForm) -> ResourceId {
    let [w, h, depth] = form.size;
    let shape = Shape::Volume(VolumeType { size: form.size, channels: form.volume_channels(), precision: Precision::F32 });
    let slice = u64::from(w) * u64::from(h) * u64::from(form.channels) * form.voxel.bytes();
    let most = (cx.limits().max_binding_bytes / slice / 4 * 4).clamp(4, u64::from(depth).max(4)) as u32;
    let mut volume = None;
    for first in (0..depth).step_by(most as usize) {
        let end = (first + most).min(depth);
        let range = u64::from(first) * slice..u64::from(end) * slice;
        let origin = Origin::External { name: name.to_owned(), ranges: vec![range.clone()] };
        let words = cx.graph.add(Resource { name: format!("{name}.file"), shape: words(&range), origin });
        let out = cx.graph.add(Resource { name: name.to_owned(), shape, origin: Origin::Pass });
        let tail = "fn each(xyz: vec3i) { store_out(xyz + vec3i(0, 0, FIRST_SLICE), decode(xyz)); }";
        cx.pass("decode", shader!("io/ingest_volume", tail))
            .entry(Entry::Each)
            .constant("CHANNELS", i32::from(form.channels))
            .constant("BYTES", form.voxel.bytes() as i32)
            .constant("SIGNED", matches!(form.voxel, Voxel::I8 | Voxel::I16 | Voxel::I32))
            .constant("FLOATING", matches!(form.voxel, Voxel::F16 | Voxel::F32))
            .constant("SCALED", (form.scale, form.offset) != (1.0, 0.0))
            .constant("FIRST_SLICE", first as i32)
            .param("scale", form.scale)
            .param("offset", form.offset)
            .read("words", words, Reach::Whole)
            .write_as("out", out, Access::Store, volume)
            .grid(Grid::Elements([w, h, end - first]))
            .add();
        volume = Some(out);
    }
    volume.expect("a volume has slices")
}

/// Fetches a volume as floats, x fastest, under `name`.
pub fn fetch_volume(cx: &mut Lowering<'_>, name: &str, volume: ResourceId) {
    let Shape::Volume(ty) = cx.shape(volume) else { unreachable!("the resolver checked the kind") };
    let slice = u64::from(ty.size[0]) * u64::from(ty.size[1]) * u64::from(ty.channels) * 4;
    let depth = u64::from(ty.size[2]);
    let most = (cx.limits().max_binding_bytes / slice).clamp(1, depth);
    let mut parts = Vec::new();
    let mut first = 0;
    while first < depth {
        let end = (first + most).min(depth);
        let range = first * slice..end * slice;
        let out = cx.intermediate("file", words(&range));
        cx.pass("encode", shader!("io/pack_volume", ""))
            .entry(Entry::Each)
            .constant("CHANNELS", i32::from(ty.channels))
            .constant("FIRST_SLICE", first as i32)
            .grid(Grid::Elements([ty.size[0] * ty.size[1] * (end - first) as u32, 1, 1]))
            .read("volume", volume, Reach::Point)
            .write("words", out)
            .add();
        parts.push((out, range));
        first = end;
    }
    cx.graph.fetches.push(Fetch { name: name.to_owned(), parts });
}

/// Fetches a table, a scalar or words as they are under `name`.
pub fn fetch_words(cx: &mut Lowering<'_>, name: &str, resource: ResourceId) {
    let bytes = cx.shape(resource).bytes();
    cx.graph.fetches.push(Fetch { name: name.to_owned(), parts: vec![(resource, 0..bytes)] });
}
