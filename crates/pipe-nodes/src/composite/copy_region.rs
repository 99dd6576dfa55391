//! `CopyRegion`: a rectangle, box or run of one array copied into another.

use pipe_graph::prelude::*;

use crate::shader;

/// Copies a region of `src` over a region of `dst`; the result is `dst` with that region replaced. Both may be images,
/// volumes (an image is a slice of depth 1) or tables. Channels are converted as everywhere: one channel is read as
/// grey, and a destination of fewer channels keeps the first.
///
/// A table beside an image or a volume holds its pixels row by row, each pixel's channels together: entry
/// `offset` + z·`slice_pitch` + y·`row_pitch` + x·channels + channel. Whole numbers and floats convert by value, to
/// the nearest whole number.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct CopyRegion {
    /// Where the region is read.
    src: In<Array>,
    /// What it is written over.
    dst: In<Array>,
    /// First pixel, voxel or entry read: `[x, y]`, `[x, y, z]` or `[i]`; absent: the first. A table beside an image
    /// has `offset` instead.
    #[schemars(extend("x-unit" = "px"))]
    src_origin: Vec<u32>,
    /// First pixel, voxel or entry written; absent: the first.
    #[schemars(extend("x-unit" = "px"))]
    dst_origin: Vec<u32>,
    /// Extent of the region: `[width, height]`, `[width, height, depth]` or `[entries]`; absent: as much as both hold
    /// (beside a table: as much as the image or volume holds).
    #[schemars(extend("x-unit" = "px"))]
    size: Option<Vec<u32>>,
    /// Entry of the table that holds the region's first value.
    offset: u32,
    /// Entries from one row to the next; absent: rows lie end to end.
    row_pitch: Option<u32>,
    /// Entries from one slice to the next; absent: slices lie end to end.
    slice_pitch: Option<u32>,
}

pub(crate) const KIND: Kind = Kind::of::<CopyRegion>(
    "CopyRegion",
    Category::Composite,
    &[
        r#"CopyRegion(src: "in", dst: "other", size: ["=ceil(in.width/2)", "=ceil(in.height/2)"])"#,
        r#"CopyRegion(src: "in", dst: "other", src_origin: ["=floor(in.width/2)", 0], dst_origin: [0, "=floor(in.height/3)"])"#,
        r#"CopyRegion(src: "grey", dst: "in", size: [1, "=in.height"])"#,
        r#"CopyRegion(src: "in", dst: "grey")"#,
        r#"CopyRegion(src: "volume", dst: "fog", src_origin: [1, 0, 1], dst_origin: [0, 2, 1], size: [3, 2, 4])"#,
        r#"CopyRegion(src: "grey", dst: "volume", dst_origin: [1, 2, 3], size: [1, 1])"#,
        r#"CopyRegion(src: "volume", dst: "in", src_origin: [1, 2, 3], size: [1, 1])"#,
        r#"CopyRegion(src: "table", dst: "table", src_origin: [10], dst_origin: [100], size: [20])"#,
        r#"CopyRegion(src: "table", dst: "curve")"#,
        r#"CopyRegion(src: "curve", dst: "table", dst_origin: [192])"#,
        r#"CopyRegion(src: "curve", dst: "grey", size: ["=min(grey.width, 7)", "=min(grey.height, 8)"], offset: 1, row_pitch: 7)"#,
        r#"CopyRegion(src: "table", dst: "in", size: ["=min(in.width, 3)", "=min(in.height, 5)"], row_pitch: 14)"#,
        r#"CopyRegion(src: "in", dst: "curve", size: ["=min(in.width, 3)", "=min(in.height, 4)"], offset: 2, row_pitch: 13)"#,
        r#"CopyRegion(src: "grey", dst: "table", size: ["=min(grey.width, 9)", "=min(grey.height, 9)"], offset: 100)"#,
        r#"CopyRegion(src: "curve", dst: "volume", dst_origin: [1, 1, 1], size: [2, 2, 2], row_pitch: 3, slice_pitch: 10)"#,
        r#"CopyRegion(src: "volume", dst: "curve", size: [2, 3, 2], offset: 5, row_pitch: 4, slice_pitch: 13)"#,
    ],
)
.tolerance(0.0, 0.0);

/// Extents and channels of anything that can be copied.
fn extent(ty: &EdgeType) -> Result<([u32; 3], u32), Mistake> {
    match ty {
        EdgeType::Image(t) => Ok(([t.size[0], t.size[1], 1], u32::from(t.channels))),
        EdgeType::Volume(t) => Ok((t.size, u32::from(t.channels))),
        EdgeType::Table(t) => Ok(([t.len, 1, 1], 1)),
        other => Err(Mistake::new(format!("cannot copy a {}", other.kind())).hint("expected images, volumes or tables")),
    }
}

/// Three coordinates from one to three, the missing ones filled.
fn three(field: &str, given: &[u32], missing: u32) -> Result<[u32; 3], Mistake> {
    if given.len() > 3 {
        return Err(Mistake::in_field(field, format!("has {} numbers", given.len())).hint("expected [x, y], [x, y, z] or [i]"));
    }
    Ok(std::array::from_fn(|i| given.get(i).copied().unwrap_or(missing)))
}

/// Which region, and how it lies in a table.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Region {
    src: [u32; 3],
    dst: [u32; 3],
    size: [u32; 3],
    row_pitch: u32,
    slice_pitch: u32,
    /// Channels of the pixels that a table holds.
    channels: u32,
}

const AXES: [&str; 3] = ["width", "height", "depth"];

impl CopyRegion {
    fn region(&self, src: &EdgeType, dst: &EdgeType) -> Result<Region, Mistake> {
        let is_table = |ty: &EdgeType| ty.kind() == EdgeKind::Table;
        let ((src_extent, src_channels), (dst_extent, dst_channels)) = (extent(src)?, extent(dst)?);
        let origins = [three("src_origin", &self.src_origin, 0)?, three("dst_origin", &self.dst_origin, 0)?];
        // A table beside pixels has no extent of its own: only pitches and its length.
        let mixed = is_table(src) != is_table(dst);
        let bounded = [!(mixed && is_table(src)), !(mixed && is_table(dst))];
        let sides = [("src_origin", origins[0], src_extent, bounded[0]), ("dst_origin", origins[1], dst_extent, bounded[1])];
        let mut rest = [u32::MAX; 3];
        for (field, origin, extent, bounded) in sides {
            if !bounded {
                if origin != [0; 3] {
                    return Err(Mistake::in_field(field, "a table beside an image has no origin").hint("give its first entry as `offset`"));
                }
                continue;
            }
            for i in 0..3 {
                if origin[i] >= extent[i] {
                    return Err(Mistake::in_field(field, format!("begins outside: {} of {} {}", origin[i], AXES[i], extent[i])));
                }
                rest[i] = rest[i].min(extent[i] - origin[i]);
            }
        }
        let size = self.size.as_ref().map_or(Ok(rest), |given| three("size", given, 1))?;
        for i in 0..3 {
            if size[i] == 0 || size[i] > rest[i] {
                return Err(Mistake::in_field("size", format!("the {} is {}", AXES[i], size[i]))
                    .hint(format!("from these origins on, at most {} fit; at least 1", rest[i])));
            }
        }
        let channels = if is_table(src) { dst_channels } else { src_channels };
        let region = Region { src: origins[0], dst: origins[1], size, row_pitch: 0, slice_pitch: 0, channels };
        if mixed { self.pitched(region, if is_table(src) { src_extent[0] } else { dst_extent[0] }) } else { Ok(region) }
    }

    /// The region with its pitches, if it fits into a table of `len` entries.
    fn pitched(&self, region: Region, len: u32) -> Result<Region, Mistake> {
        let [w, h, d] = region.size.map(u64::from);
        let row = w * u64::from(region.channels);
        let row_pitch = self.row_pitch.map_or(row, u64::from);
        if row_pitch < row {
            return Err(Mistake::in_field("row_pitch", format!("is {row_pitch}, but a row takes {row} entries"))
                .hint(format!("expected at least {row}")));
        }
        let slice = row_pitch * h;
        let slice_pitch = self.slice_pitch.map_or(slice, u64::from);
        if slice_pitch < slice {
            return Err(Mistake::in_field("slice_pitch", format!("is {slice_pitch}, but a slice takes {slice} entries"))
                .hint(format!("expected at least {slice}")));
        }
        let end = u64::from(self.offset) + (d - 1) * slice_pitch + (h - 1) * row_pitch + row;
        if end > u64::from(len) {
            return Err(Mistake::new(format!("the region takes {end} entries of a table of {len}"))
                .hint("give a smaller `size`, `offset` or `row_pitch`"));
        }
        // Pitches beyond the table are those of a single row or slice.
        let clamped = |pitch: u64| u32::try_from(pitch).unwrap_or(u32::MAX).min(i32::MAX as u32);
        Ok(Region { row_pitch: clamped(row_pitch), slice_pitch: clamped(slice_pitch), ..region })
    }

    /// Entry of the table for a pixel of the region.
    fn entry(&self, region: &Region, [x, y, z]: [u32; 3]) -> usize {
        let [x, y, z] = [x, y, z].map(|v| v as usize);
        self.offset as usize + z * region.slice_pitch as usize + y * region.row_pitch as usize + x * region.channels as usize
    }
}

fn type_of(tensor: &Tensor) -> EdgeType {
    match tensor {
        Tensor::Image(image) => EdgeType::image(image.size, image.channels),
        Tensor::Volume(block) => EdgeType::volume(block.size, block.channels),
        Tensor::Table(values) => EdgeType::table(values.len() as u32, Element::F32),
        Tensor::Scalar(_) | Tensor::Mesh(_) => unreachable!("the resolver binds images, volumes and tables"),
    }
}

fn source_part(ty: &EdgeType) -> Shader {
    match ty {
        EdgeType::Volume(_) => shader!("composite/copy_from_volume"),
        EdgeType::Table(_) => shader!("composite/copy_from_table"),
        _ => shader!("composite/copy_from_image"),
    }
}

fn target_part(src: &EdgeType, dst: &EdgeType) -> Shader {
    match (src, dst) {
        (_, EdgeType::Volume(_)) => shader!("composite/copy_to_volume"),
        (EdgeType::Table(_), EdgeType::Table(_)) => shader!("composite/copy_table"),
        (_, EdgeType::Table(_)) => shader!("composite/copy_to_table"),
        _ => shader!("composite/copy_to_image"),
    }
}

/// `fn entry(v)`: a value as an entry of the destination table, of type `Entry`.
fn conversion(src: &EdgeType, dst: &EdgeType) -> &'static str {
    let (EdgeType::Table(to), from) = (dst, src) else { return "" };
    match (from, to.element) {
        (EdgeType::Table(TableType { element: Element::U32, .. }), Element::U32) => {
            "alias Entry = u32;\nfn entry(v: u32) -> u32 { return v; }\n"
        }
        (_, Element::U32) => "alias Entry = u32;\nfn entry(v: f32) -> u32 { return u32(round(clamp(v, 0.0, 4294967040.0))); }\n",
        (EdgeType::Table(TableType { element: Element::U32, .. }), Element::F32) => {
            "alias Entry = f32;\nfn entry(v: u32) -> f32 { return f32(v); }\n"
        }
        (_, Element::F32) => "alias Entry = f32;\nfn entry(v: f32) -> f32 { return v; }\n",
    }
}

impl Node for CopyRegion {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let (src, dst) = (inputs.ty(self.src.edge), inputs.ty(self.dst.edge));
        self.region(&src, &dst)?;
        Ok(Output::out(dst))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let (src_type, dst_type) = (cx.ty(self.src.edge), cx.ty(self.dst.edge));
        let region = self.region(&src_type, &dst_type)?;
        let (from, to) = (source_part(&src_type), target_part(&src_type, &dst_type));
        let text = format!("{}\n{}\n{}", to.source, from.source, conversion(&src_type, &dst_type));
        let (src, dst, out) = (cx.input(&self.src), cx.input(&self.dst), cx.output("out"));
        let integers = |v: [u32; 3]| v.map(|n| n as i32);
        cx.pass("", Shader::builtin(&to.path, &text))
            .read("src", src, Reach::Whole)
            .read("dst", dst, Reach::Point)
            .write("out", out)
            .constant("CHANNELS", region.channels as i32)
            .param("src_origin", integers(region.src))
            .param("dst_origin", integers(region.dst))
            .param("extent", integers(region.size))
            .param("offset", self.offset as i32)
            .param("row_pitch", region.row_pitch as i32)
            .param("slice_pitch", region.slice_pitch as i32)
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let (src, mut out) = (cx.input(&self.src), cx.input(&self.dst).clone());
        let region = self.region(&type_of(src), &type_of(&out)).expect("`outputs` has checked the region");
        // A twin's table does not say what its entries are; whole numbers throughout are u32.
        let whole = matches!(&out, Tensor::Table(values) if values.iter().all(|v| v.fract() == 0.0));
        let put = |value: f64| if whole { value.clamp(0.0, 4_294_967_040.0).round_ties_even() } else { value };
        for z in 0..region.size[2] {
            for y in 0..region.size[1] {
                for x in 0..region.size[0] {
                    let at = [x, y, z];
                    let [i, o] = [region.src, region.dst].map(|origin| [0, 1, 2].map(|k| (origin[k] + at[k]) as usize));
                    let entry = self.entry(&region, at);
                    let channels = region.channels as usize;
                    let pixel = match src {
                        Tensor::Image(image) => image.pixels[i[1] * image.size[0] as usize + i[0]],
                        Tensor::Volume(block) => block.load(i.map(|v| v as i64), Border::Clamp),
                        Tensor::Table(values) if matches!(out, Tensor::Table(_)) => [values[i[0]], 0.0, 0.0, 1.0],
                        Tensor::Table(values) => {
                            let mut pixel = [0.0, 0.0, 0.0, 1.0];
                            pixel[..channels].copy_from_slice(&values[entry..entry + channels]);
                            pixel
                        }
                        _ => unreachable!("`outputs` has checked the types"),
                    };
                    match &mut out {
                        Tensor::Image(image) => {
                            image.pixels[o[1] * image.size[0] as usize + o[0]] = narrow(pixel, image.channels);
                        }
                        Tensor::Volume(block) => {
                            let [w, h, _] = block.size.map(|n| n as usize);
                            block.voxels[(o[2] * h + o[1]) * w + o[0]] = narrow(pixel, block.channels);
                        }
                        Tensor::Table(values) if matches!(src, Tensor::Table(_)) => values[o[0]] = put(pixel[0]),
                        Tensor::Table(values) => (0..channels).for_each(|c| values[entry + c] = put(pixel[c])),
                        _ => unreachable!("`outputs` has checked the types"),
                    }
                }
            }
        }
        vec![out]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IMAGE: EdgeType = EdgeType::image([8, 4], 4);
    const TABLE: EdgeType = EdgeType::table(64, Element::F32);

    #[test]
    fn absent_size_is_what_both_hold() {
        let copy = CopyRegion { src_origin: vec![3], dst_origin: vec![0, 1], ..CopyRegion::default() };
        assert_eq!(copy.region(&IMAGE, &EdgeType::image([4, 9], 1)).map(|r| r.size), Ok([4, 4, 1]));
        assert_eq!(copy.region(&IMAGE, &EdgeType::image([9, 4], 1)).map(|r| r.size), Ok([5, 3, 1]));
    }

    #[test]
    fn regions_that_do_not_fit_are_mistakes() {
        let field = |copy: CopyRegion, src: &EdgeType, dst: &EdgeType| copy.region(src, dst).unwrap_err().field;
        let wide = CopyRegion { size: Some(vec![9, 1]), ..CopyRegion::default() };
        assert_eq!(field(wide, &IMAGE, &IMAGE).as_deref(), Some("size"));
        let outside = CopyRegion { dst_origin: vec![8], ..CopyRegion::default() };
        assert_eq!(field(outside, &IMAGE, &IMAGE).as_deref(), Some("dst_origin"));
        let narrow = CopyRegion { size: Some(vec![2, 2]), row_pitch: Some(7), ..CopyRegion::default() };
        assert_eq!(field(narrow, &TABLE, &IMAGE).as_deref(), Some("row_pitch"));
        let long = CopyRegion { offset: 1, size: Some(vec![4, 4]), ..CopyRegion::default() };
        assert_eq!(field(long, &IMAGE, &TABLE), None);
    }
}
