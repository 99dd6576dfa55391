//! Ports: how bound resources are declared, and the functions that a stage sees.

use std::fmt::Write as _;

use pipe_graph::pass::{Access, Border, Entry, Filter, Limits, ResourceId, Shape};
use pipe_graph::types::{Element, ImageType, Precision};

use super::Use;
use crate::kernel_pass::{KernelPass, Source, Stage, StagePort};
use crate::plan::Binding;

/// What is behind a read port.
pub(super) enum Raw {
    /// The n-th bound resource.
    Bound(usize),
    /// The value of an earlier stage.
    Stage { producer: usize, size: Size },
}

/// Where a size comes from.
pub(super) enum Size {
    Bound(usize),
    Fixed(Shape),
}

impl Size {
    /// The expression of an image's size.
    pub(super) fn text(&self) -> String {
        match self {
            Self::Bound(i) => format!("package::io::size_r{i}()"),
            Self::Fixed(Shape::Image(t)) => format!("vec2i({}, {})", t.size[0], t.size[1]),
            Self::Fixed(_) => "vec2i(1, 1)".to_owned(),
        }
    }
}

/// The name of a texel format in WGSL.
fn texel(channels: u8, precision: Precision, limits: &Limits) -> &'static str {
    let half = precision == Precision::F16 && (channels == 4 || limits.half_storage);
    match (channels, half) {
        (1, false) => "r32float",
        (2, false) => "rg32float",
        (_, false) => "rgba32float",
        (1, true) => "r16float",
        (2, true) => "rg16float",
        (_, true) => "rgba16float",
    }
}

fn stored(precision: Precision, channels: u8, limits: &Limits) -> Precision {
    if channels < 4 && !limits.half_storage { Precision::F32 } else { precision }
}

pub(super) fn binding(shape: Shape, use_: Use, limits: &Limits) -> Binding {
    match (shape, use_) {
        (Shape::Image(_), Use::Read) => Binding::SampledImage,
        (Shape::Volume(_), Use::Read) => Binding::SampledVolume,
        (Shape::Image(mut t), Use::Write(_)) => {
            t.precision = stored(t.precision, t.channels, limits);
            Binding::StorageImage(t)
        }
        (Shape::Volume(mut t), Use::Write(_)) => {
            t.precision = stored(t.precision, t.channels, limits);
            Binding::StorageVolume(t)
        }
        (_, Use::Read) => Binding::ReadBuffer,
        (_, Use::Write(_)) => Binding::WriteBuffer,
    }
}

fn element(shape: Shape) -> &'static str {
    match shape {
        Shape::Table { element: Element::F32, .. } => "f32",
        Shape::Scalar => "vec4f",
        _ => "u32",
    }
}

/// Declares an image of which only a window is held: positions and the size are those of the whole image.
pub(super) fn declare_window(io: &mut String, i: usize, at: usize, image: ImageType, use_: Use, limits: &Limits) {
    let head = format!("@group(0) @binding({at})");
    let _ = match use_ {
        // Loops compute more than the window holds; nobody uses what they make of the pixels at its edge.
        Use::Read => writeln!(
            io,
            "{head} var r{i}: texture_2d<f32>;\n\
             fn fetch_r{i}(p: vec2i) -> vec4f {{ \
             let v = textureLoad(r{i}, clamp(p - uniforms.r{i}_first, vec2i(0), uniforms.r{i}_size - 1), 0); return {}; }}",
            grey("v", image.channels)
        ),
        Use::Write(_) => writeln!(
            io,
            "{head} var r{i}: texture_storage_2d<{}, write>;\n\
             fn put_r{i}(p: vec2i, v: vec4f) {{ let q = p - uniforms.r{i}_first; \
             if all(q >= vec2i(0)) && all(q < uniforms.r{i}_size) {{ textureStore(r{i}, q, v); }} }}",
            texel(image.channels, image.precision, limits)
        ),
    };
    let _ = writeln!(io, "fn size_r{i}() -> vec2i {{ return uniforms.r{i}_whole; }}");
}

/// Declares an image that is held whole and written tile by tile: what belongs to other tiles is left alone.
pub(super) fn declare_tile(io: &mut String, i: usize, at: usize, image: ImageType, limits: &Limits) {
    let _ = writeln!(
        io,
        "@group(0) @binding({at}) var r{i}: texture_storage_2d<{}, write>;\n\
         fn size_r{i}() -> vec2i {{ return vec2i(textureDimensions(r{i})); }}\n\
         fn put_r{i}(p: vec2i, v: vec4f) {{ let q = p - uniforms.r{i}_first; \
         if all(q >= vec2i(0)) && all(q < uniforms.r{i}_size) {{ textureStore(r{i}, p, v); }} }}",
        texel(image.channels, image.precision, limits)
    );
}

/// Declares binding `at` as resource `i`, with `size_rI`, `fetch_rI` or `put_rI`.
pub(super) fn declare(io: &mut String, i: usize, at: usize, shape: Shape, use_: Use, limits: &Limits) {
    let head = format!("@group(0) @binding({at})");
    let _ = match (shape, use_) {
        (Shape::Image(t), Use::Read) => {
            let value = grey("v", t.channels);
            writeln!(
                io,
                "{head} var r{i}: texture_2d<f32>;\n\
                 fn size_r{i}() -> vec2i {{ return vec2i(textureDimensions(r{i}, 0)); }}\n\
                 fn fetch_r{i}(p: vec2i) -> vec4f {{ let v = textureLoad(r{i}, p, 0); return {value}; }}"
            )
        }
        (Shape::Volume(t), Use::Read) => {
            let value = grey("v", t.channels);
            writeln!(
                io,
                "{head} var r{i}: texture_3d<f32>;\n\
                 fn size_r{i}() -> vec3i {{ return vec3i(textureDimensions(r{i}, 0)); }}\n\
                 fn fetch_r{i}(p: vec3i) -> vec4f {{ let v = textureLoad(r{i}, p, 0); return {value}; }}"
            )
        }
        (Shape::Image(t), Use::Write(_)) => {
            let format = texel(t.channels, t.precision, limits);
            writeln!(
                io,
                "{head} var r{i}: texture_storage_2d<{format}, write>;\n\
                 fn size_r{i}() -> vec2i {{ return vec2i(textureDimensions(r{i})); }}\n\
                 fn put_r{i}(p: vec2i, v: vec4f) {{ textureStore(r{i}, p, v); }}"
            )
        }
        (Shape::Volume(t), Use::Write(_)) => {
            let format = texel(t.channels, t.precision, limits);
            writeln!(
                io,
                "{head} var r{i}: texture_storage_3d<{format}, write>;\n\
                 fn size_r{i}() -> vec3i {{ return vec3i(textureDimensions(r{i})); }}\n\
                 fn put_r{i}(p: vec3i, v: vec4f) {{ textureStore(r{i}, p, v); }}"
            )
        }
        (Shape::Scalar, Use::Read) => writeln!(io, "{head} var<storage, read> r{i}: vec4f;"),
        (Shape::Scalar, Use::Write(_)) => {
            writeln!(io, "{head} var<storage, read_write> r{i}: vec4f;\nfn put_r{i}(p: i32, v: vec4f) {{ r{i} = v; }}")
        }
        (_, Use::Read) => {
            let ty = element(shape);
            writeln!(io, "{head} var<storage, read> r{i}: array<{ty}>;")
        }
        (_, Use::Write(Access::Atomic | Access::AtomicUpdate)) => {
            writeln!(io, "{head} var<storage, read_write> r{i}: array<atomic<u32>>;")
        }
        (_, Use::Write(_)) => {
            let ty = element(shape);
            writeln!(io, "{head} var<storage, read_write> r{i}: array<{ty}>;\nfn put_r{i}(p: i32, v: {ty}) {{ r{i}[p] = v; }}")
        }
    };
}

/// `first_NAME` and `held_NAME` of pixels of a file: which pixels of the picture the table holds.
pub(super) fn pixels_port(text: &mut String, n: &str, i: usize, size: [u32; 2], windowed: bool) {
    let _ = if windowed {
        writeln!(
            text,
            "fn first_{n}() -> vec2i {{ return package::io::uniforms.r{i}_first; }}\n\
             fn held_{n}() -> vec2i {{ return package::io::uniforms.r{i}_size; }}"
        )
    } else {
        let [w, h] = size;
        writeln!(text, "fn first_{n}() -> vec2i {{ return vec2i(0); }}\nfn held_{n}() -> vec2i {{ return vec2i({w}, {h}); }}")
    };
}

/// What a texture's answer means: one channel is grey.
fn grey(v: &str, channels: u8) -> String {
    match channels {
        1 => format!("vec4f({v}.r, {v}.r, {v}.r, 1.0)"),
        _ => v.to_owned(),
    }
}

/// What is left of a value in so many channels: as if it had been stored and loaded.
pub(super) fn narrow(v: &str, shape: Shape) -> String {
    let channels = match shape {
        Shape::Image(t) => t.channels,
        Shape::Volume(t) => t.channels,
        _ => 4,
    };
    match channels {
        1 => format!("package::lib::value::grey({v})"),
        2 => format!("package::lib::value::pair({v})"),
        _ => v.to_owned(),
    }
}

/// `load_`, `sample_` and `size_` of an input.
pub(super) fn read_port(text: &mut String, port: &StagePort, raw: Raw) {
    let n = &port.name;
    match port.shape {
        Shape::Image(_) | Shape::Volume(_) => {
            let volume = matches!(port.shape, Shape::Volume(_));
            let (vi, vf) = if volume { ("vec3i", "vec3f") } else { ("vec2i", "vec2f") };
            let (size, fetch) = match raw {
                Raw::Bound(i) => (format!("package::io::size_r{i}()"), format!("package::io::fetch_r{i}(p)")),
                Raw::Stage { producer, size } => (size.text(), format!("package::s{producer}::value(p)")),
            };
            let place = match port.border {
                Border::Clamp => format!("let p = clamp(xy, {vi}(0), size_{n}() - 1);"),
                Border::Repeat => format!("let s = size_{n}(); let p = ((xy % s) + s) % s;"),
                Border::Mirror => {
                    format!("let s = size_{n}(); let m = ((xy % (2 * s)) + 2 * s) % (2 * s); let p = min(m, 2 * s - 1 - m);")
                }
                Border::Black => format!("if any(xy < {vi}(0)) || any(xy >= size_{n}()) {{ return vec4f(); }} let p = xy;"),
            };
            let _ =
                writeln!(text, "fn size_{n}() -> {vi} {{ return {size}; }}\nfn load_{n}(xy: {vi}) -> vec4f {{ {place} return {fetch}; }}");
            let sample = match (port.filter, volume) {
                (Filter::Nearest, _) => format!("return load_{n}({vi}(floor(uv * {vf}(size_{n}()))));"),
                (Filter::Linear, false) => format!(
                    "let at = uv * vec2f(size_{n}()) - 0.5; let b = floor(at); let f = at - b; let i = vec2i(b);\n\
                     return mix(mix(load_{n}(i), load_{n}(i + vec2i(1, 0)), f.x), \
                     mix(load_{n}(i + vec2i(0, 1)), load_{n}(i + vec2i(1, 1)), f.x), f.y);"
                ),
                (Filter::Linear, true) => format!(
                    "let at = uv * vec3f(size_{n}()) - 0.5; let b = floor(at); let f = at - b; let i = vec3i(b);\n\
                     let near = mix(mix(load_{n}(i), load_{n}(i + vec3i(1, 0, 0)), f.x), \
                     mix(load_{n}(i + vec3i(0, 1, 0)), load_{n}(i + vec3i(1, 1, 0)), f.x), f.y);\n\
                     let far = mix(mix(load_{n}(i + vec3i(0, 0, 1)), load_{n}(i + vec3i(1, 0, 1)), f.x), \
                     mix(load_{n}(i + vec3i(0, 1, 1)), load_{n}(i + vec3i(1, 1, 1)), f.x), f.y);\n\
                     return mix(near, far, f.z);"
                ),
            };
            let _ = writeln!(text, "fn sample_{n}(uv: {vf}) -> vec4f {{ {sample} }}");
        }
        Shape::Scalar => {
            let Raw::Bound(i) = raw else { unreachable!("only images are values of stages") };
            let _ = writeln!(text, "fn load_{n}() -> vec4f {{ return package::io::r{i}; }}");
        }
        Shape::Table { .. } | Shape::Words { .. } | Shape::Pixels { .. } => {
            let Raw::Bound(i) = raw else { unreachable!("only images are values of stages") };
            let (ty, len) = (element(port.shape), port.shape.entries());
            let _ = writeln!(
                text,
                "fn size_{n}() -> i32 {{ return {len}; }}\n\
                 fn load_{n}(i: i32) -> {ty} {{ if u32(i) >= {len}u {{ return {ty}(0); }} return package::io::r{i}[i]; }}"
            );
        }
    }
}

/// `store_` and the like of an output.
pub(super) fn write_port(text: &mut String, n: &str, i: usize, shape: Shape, access: Access) {
    let _ = match shape {
        Shape::Image(_) => writeln!(
            text,
            "fn size_{n}() -> vec2i {{ return package::io::size_r{i}(); }}\n\
             fn store_{n}(xy: vec2i, v: vec4f) {{ if all(xy >= vec2i(0)) && all(xy < size_{n}()) {{ package::io::put_r{i}(xy, v); }} }}"
        ),
        Shape::Volume(_) => writeln!(
            text,
            "fn size_{n}() -> vec3i {{ return package::io::size_r{i}(); }}\n\
             fn store_{n}(xyz: vec3i, v: vec4f) {{ if all(xyz >= vec3i(0)) && all(xyz < size_{n}()) {{ package::io::put_r{i}(xyz, v); }} }}"
        ),
        Shape::Scalar => writeln!(text, "fn store_{n}(v: vec4f) {{ package::io::put_r{i}(0, v); }}"),
        Shape::Table { .. } | Shape::Words { .. } | Shape::Pixels { .. } => {
            let (ty, len) = (element(shape), shape.entries());
            let _ = writeln!(text, "fn size_{n}() -> i32 {{ return {len}; }}");
            match access {
                Access::Store => {
                    writeln!(text, "fn store_{n}(i: i32, v: {ty}) {{ if u32(i) < {len}u {{ package::io::put_r{i}(i, v); }} }}")
                }
                Access::Update => writeln!(
                    text,
                    "fn load_{n}(i: i32) -> {ty} {{ if u32(i) >= {len}u {{ return {ty}(0); }} return package::io::r{i}[i]; }}\n\
                     fn store_{n}(i: i32, v: {ty}) {{ if u32(i) < {len}u {{ package::io::put_r{i}(i, v); }} }}"
                ),
                Access::Atomic | Access::AtomicUpdate => {
                    for (name, function) in [("add", "atomicAdd"), ("min", "atomicMin"), ("max", "atomicMax")] {
                        let _ = writeln!(
                            text,
                            "fn {name}_{n}(i: i32, v: u32) -> u32 {{ if u32(i) >= {len}u {{ return 0u; }} return {function}(&package::io::r{i}[i], v); }}"
                        );
                    }
                    writeln!(
                        text,
                        "fn load_{n}(i: i32) -> u32 {{ if u32(i) >= {len}u {{ return 0u; }} return atomicLoad(&package::io::r{i}[i]); }}\n\
                         fn store_{n}(i: i32, v: u32) {{ if u32(i) < {len}u {{ atomicStore(&package::io::r{i}[i], v); }} }}"
                    )
                }
            }
        }
    };
}

/// `pixel()` and `size_out()`.
pub(super) fn place(text: &mut String, out: usize, stage: &Stage) {
    text.push_str("fn pixel() -> vec2i { return package::io::current; }\n");
    let declared = stage.ports.iter().any(|p| p.name == "out") || text.contains("fn size_out()");
    if !declared {
        match stage.shape {
            Shape::Image(t) if stage.entry == Entry::Points => {
                let _ = writeln!(text, "fn size_out() -> vec2i {{ return vec2i({}, {}); }}", t.size[0], t.size[1]);
            }
            Shape::Image(t) if stage.entry == Entry::Point => {
                // The stage may have been fused in front of a pass that writes something of another size.
                let _ = writeln!(text, "fn size_out() -> vec2i {{ return vec2i({}, {}); }}", t.size[0], t.size[1]);
            }
            Shape::Image(_) => {
                let _ = writeln!(text, "fn size_out() -> vec2i {{ return package::io::size_r{out}(); }}");
            }
            Shape::Volume(_) => {
                let _ = writeln!(text, "fn size_out() -> vec3i {{ return package::io::size_r{out}(); }}");
            }
            _ => {}
        }
    }
}

/// `value(p)`: the result of a `Point` stage at any pixel, as if it had been stored and loaded.
pub(super) fn point_value(text: &mut String, s: usize, pass: &KernelPass, index: &dyn Fn(ResourceId, bool) -> usize) {
    let stage = &pass.stages[s];
    let mut args = Vec::new();
    for port in stage.ports.iter().filter(|p| matches!(p.shape, Shape::Image(_))) {
        args.push(match port.source {
            Source::Read(r) => format!("package::io::fetch_r{}(p)", index(pass.reads[r], false)),
            Source::Stage(k) => format!("package::s{k}::value(p)"),
        });
    }
    let call = format!("apply({})", args.join(", "));
    // Arguments that are stages set the place themselves, to the same pixel.
    let _ = writeln!(text, "fn value(p: vec2i) -> vec4f {{ package::io::current = p; return {}; }}", narrow(&call, stage.shape));
}
