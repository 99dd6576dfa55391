//! The uniform block of a kernel: parameters of all its stages, laid out by WGSL's rules, and `params` in each stage.

use std::fmt::Write as _;

use pipe_graph::pass::{Constant, Entry, ResourceId, Value};

use crate::kernel_pass::{KernelPass, Stage};

/// Where each parameter stands, and behind the parameters what a kernel must know of its tile.
pub(super) struct Block {
    fields: Vec<Field>,
    places: Vec<Place>,
    bytes: usize,
}

/// A `vec2i` that differs from tile to tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    /// What it is.
    pub(crate) what: Placed,
    /// Its name in the block.
    bound: usize,
    /// Byte offset in the block.
    pub(crate) offset: usize,
}

/// What a kernel is told of its tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Placed {
    /// The first pixel (or block) that the grid covers, and the one behind its last.
    GridFirst,
    GridEnd,
    /// The first pixel of a window, and its size.
    First(ResourceId),
    Size(ResourceId),
    /// Width and height of the image that it shows. No constant, as it is none where an image is held whole: compilers
    /// divide by constants in other ways.
    Whole(ResourceId),
}

struct Field {
    stage: usize,
    name: String,
    ty: &'static str,
    offset: usize,
    bytes: usize,
}

/// WGSL type, alignment and size.
fn layout(value: &Value) -> (&'static str, usize, usize) {
    match value {
        Value::F32(_) | Value::Driven(_) => ("f32", 4, 4),
        Value::I32(_) => ("i32", 4, 4),
        Value::U32(_) => ("u32", 4, 4),
        Value::Vec2(_) => ("vec2f", 8, 8),
        Value::Vec3(_) => ("vec3f", 16, 12),
        Value::Vec4(_) => ("vec4f", 16, 16),
        Value::Vec2I(_) => ("vec2i", 8, 8),
        Value::Vec3I(_) => ("vec3i", 16, 12),
    }
}

fn words(value: &Value) -> Vec<u8> {
    fn all<const N: usize, T: Copy>(v: &[T; N], bytes: fn(T) -> [u8; 4]) -> Vec<u8> {
        v.iter().flat_map(|x| bytes(*x)).collect()
    }
    match value {
        Value::F32(v) => v.to_le_bytes().to_vec(),
        Value::I32(v) => v.to_le_bytes().to_vec(),
        Value::U32(v) => v.to_le_bytes().to_vec(),
        Value::Vec2(v) => all(v, f32::to_le_bytes),
        Value::Vec3(v) => all(v, f32::to_le_bytes),
        Value::Vec4(v) => all(v, f32::to_le_bytes),
        Value::Vec2I(v) => all(v, i32::to_le_bytes),
        Value::Vec3I(v) => all(v, i32::to_le_bytes),
        Value::Driven(_) => vec![0; 4],
    }
}

impl Block {
    /// The block of a pass; `windowed` are the bound resources of which only a window is held, by their number.
    pub(super) fn new(pass: &KernelPass, windowed: Option<&[(usize, ResourceId)]>) -> Self {
        let mut fields = Vec::new();
        let mut offset = 0_usize;
        for (stage, s) in pass.stages.iter().enumerate() {
            for (name, value) in &s.params {
                if matches!(value, Value::Driven(_)) {
                    continue;
                }
                let (ty, align, bytes) = layout(value);
                offset = offset.next_multiple_of(align);
                fields.push(Field { stage, name: name.clone(), ty, offset, bytes });
                offset += bytes;
            }
        }
        let mut places = Vec::new();
        if let Some(windowed) = windowed {
            let of_windows =
                windowed.iter().flat_map(|(i, id)| [Placed::First(*id), Placed::Size(*id), Placed::Whole(*id)].map(|what| (what, *i)));
            for (what, bound) in [(Placed::GridFirst, 0), (Placed::GridEnd, 0)].into_iter().chain(of_windows) {
                offset = offset.next_multiple_of(8);
                places.push(Place { what, bound, offset });
                offset += 8;
            }
        }
        Self { fields, places, bytes: offset }
    }

    /// What differs from tile to tile.
    pub(super) fn into_places(self) -> Vec<Place> {
        self.places
    }

    /// The content, padded to 16 bytes, without what differs from tile to tile; empty when there is nothing in it.
    pub(super) fn bytes(&self, pass: &KernelPass) -> Vec<u8> {
        let mut out = vec![0; self.bytes.next_multiple_of(16)];
        for f in &self.fields {
            out[f.offset..f.offset + f.bytes].copy_from_slice(&words(&pass.stages[f.stage].params[&f.name]));
        }
        out
    }

    pub(super) fn declaration(&self) -> String {
        let mut fields: String = self.fields.iter().map(|f| format!("    s{}_{}: {},\n", f.stage, f.name, f.ty)).collect();
        for place in &self.places {
            let _ = match place.what {
                Placed::GridFirst => writeln!(fields, "    grid_first: vec2i,"),
                Placed::GridEnd => writeln!(fields, "    grid_end: vec2i,"),
                Placed::First(_) => writeln!(fields, "    r{}_first: vec2i,", place.bound),
                Placed::Size(_) => writeln!(fields, "    r{}_size: vec2i,", place.bound),
                Placed::Whole(_) => writeln!(fields, "    r{}_whole: vec2i,", place.bound),
            };
        }
        format!("struct Uniforms {{\n{fields}}}\n@group(0) @binding(0) var<uniform> uniforms: Uniforms;\n")
    }

    /// `params` of one stage: private, filled by `bind_params`.
    pub(super) fn params(&self, text: &mut String, stage: usize, s: &Stage, drivers: &[ResourceId]) {
        if s.params.is_empty() {
            return;
        }
        let mut members = String::new();
        let mut values = Vec::new();
        for (name, value) in &s.params {
            let _ = writeln!(members, "    {name}: {},", layout(value).0);
            values.push(match value {
                Value::Driven(id) => {
                    let d = drivers.iter().position(|r| r == id).expect("drivers are those of the stages");
                    format!("package::io::d{d}.x")
                }
                _ => format!("package::io::uniforms.s{stage}_{name}"),
            });
        }
        let _ = write!(
            text,
            "struct Params {{\n{members}}}\nvar<private> params: Params;\nfn bind_params() {{ params = Params({}); }}\n",
            values.join(", ")
        );
    }
}

/// The calls that fill `params` of all stages, for the start of the entry point.
pub(super) fn bind_calls(pass: &KernelPass) -> Vec<String> {
    // The last stage of a `Kernel` is the main module itself.
    let main = (pass.last().entry == Entry::Kernel).then(|| pass.stages.len() - 1);
    let with_params = (0..pass.stages.len()).filter(|s| !pass.stages[*s].params.is_empty());
    with_params.map(|s| if main == Some(s) { "bind_params();".to_owned() } else { format!("package::s{s}::bind_params();") }).collect()
}

/// Puts those calls at the start of a `Kernel`'s own entry point, in the line of its brace, so that lines keep their numbers.
pub(super) fn bind_in_main(text: &mut String, pass: &KernelPass) {
    if let Some(at) = body_of_main(text) {
        text.insert_str(at, &format!(" {} ", bind_calls(pass).join(" ")));
    }
}

/// Just behind the brace that opens the body of `fn main`.
fn body_of_main(text: &str) -> Option<usize> {
    let mut from = 0;
    let main = loop {
        let at = from + text[from..].find("fn main")?;
        let line = text[..at].rfind('\n').map_or(0, |i| i + 1);
        if !text[line..at].contains("//") {
            break at;
        }
        from = at + 1;
    };
    let mut depth = 0;

    text[main..].char_indices().find_map(|(i, c)| {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            '{' if depth == 0 => return Some(main + i + 1),
            _ => {}
        }
        None
    })
}

pub(super) fn constant(name: &str, value: Constant) -> String {
    match value {
        Constant::I32(v) => format!("const {name}: i32 = i32({v});\n"),
        Constant::U32(v) => format!("const {name}: u32 = {v}u;\n"),
        Constant::F32(v) => format!("const {name}: f32 = {v:?}f;\n"),
        Constant::Bool(v) => format!("const {name}: bool = {v};\n"),
    }
}
