//! `Wgsl`: a pass that the user wrote.

use indexmap::IndexMap;
use pipe_graph::prelude::*;
use pipe_graph::wgsl::{self, LIBRARY, PortShape, Signature, common_stubs, defines, port_stub, workgroup_size};
use smart_default::SmartDefault;

/// Runs a shader of your own. It is written like the built-in ones: mathematics over ports, no bindings.
///
/// For an image input `a` the shader has `load_a(xy)`, `sample_a(uv)` and `size_a()`; parameters are `params.NAME`. With
/// `access: Point` it defines `fn apply(a: vec4f, …) -> vec4f`, with `Around(n)` or `Whole` `fn at(xy: vec2i) -> vec4f`
/// for one output or `fn each(xy: vec2i)`, which stores by itself, for several; with `Kernel`
/// `@compute @workgroup_size(…) fn main(…)`. `shaders/README.md` is the whole contract.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Wgsl {
    /// Path of the shader, relative to the graph file.
    shader: String,
    /// Input ports by name: `{"image": "in"}`.
    inputs: IndexMap<String, In<Array>>,
    /// Output ports by name: `{"out": Image(like: "image")}`. The first is the default one.
    outputs: IndexMap<String, PortType>,
    /// Parameters by name: `{"gain": F32(default: 2.0)}`; a default may be an expression, or name a Scalar.
    params: IndexMap<String, Parameter>,
    /// How far the shader looks around a pixel. It must be true: fusion and tiling rely on it.
    #[default(Access::Whole)]
    access: Access,
    /// Of a `Kernel`: the number of workgroups along x, y, z; enough to cover the first output when absent.
    groups: Option<[u32; 3]>,
    #[serde(skip)]
    source: Option<Shader>,
}

/// The type of an output port.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
enum PortType {
    /// An image.
    Image {
        /// The input whose size and channels it has.
        #[serde(default)]
        like: Option<String>,
        /// Its size, when it is not that of an input.
        #[serde(default)]
        size: Option<[u32; 2]>,
        /// 1, 2 or 4, when not those of the input.
        #[serde(default)]
        channels: Option<u8>,
        /// Storage precision.
        #[serde(default)]
        format: Option<Precision>,
    },
    /// A volume.
    Volume {
        /// The input whose size it has.
        #[serde(default)]
        like: Option<String>,
        /// Its size, when it is not that of an input.
        #[serde(default)]
        size: Option<[u32; 3]>,
        /// 1 or 4.
        #[serde(default)]
        channels: Option<u8>,
    },
    /// A table.
    Table {
        /// Entries.
        len: u32,
        /// F32 or U32.
        #[serde(default = "floats")]
        element: Element,
    },
    /// One to four numbers.
    Scalar {
        /// 1 to 4.
        #[serde(default = "four")]
        components: u8,
    },
}

const fn floats() -> Element {
    Element::F32
}

const fn four() -> u8 {
    4
}

/// A parameter of the shader.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
enum Parameter {
    /// `f32`
    F32 {
        /// Its value, or a Scalar that drives it.
        default: Driven,
    },
    /// `i32`
    I32 {
        /// Its value.
        default: i32,
    },
    /// `u32`
    U32 {
        /// Its value.
        default: u32,
    },
    /// `vec2f`
    Vec2 {
        /// Its value.
        default: [f32; 2],
    },
    /// `vec3f`
    Vec3 {
        /// Its value.
        default: [f32; 3],
    },
    /// `vec4f`
    Vec4 {
        /// Its value.
        default: [f32; 4],
    },
}

/// How far a shader looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
enum Access {
    /// The same pixel only.
    Point,
    /// At most so many pixels to every side.
    Around(u32),
    /// Anywhere.
    Whole,
    /// Own workgroups; looks anywhere.
    Kernel,
}

pub(super) const KIND: Kind = Kind::of::<Wgsl>("Wgsl", Category::Structure, &[]);

impl Parameter {
    const fn wgsl(&self) -> &'static str {
        match self {
            Self::F32 { .. } => "f32",
            Self::I32 { .. } => "i32",
            Self::U32 { .. } => "u32",
            Self::Vec2 { .. } => "vec2f",
            Self::Vec3 { .. } => "vec3f",
            Self::Vec4 { .. } => "vec4f",
        }
    }

    fn value(&self, cx: &Lowering<'_>) -> Value {
        match self {
            Self::F32 { default } => cx.driven(default),
            Self::I32 { default } => Value::I32(*default),
            Self::U32 { default } => Value::U32(*default),
            Self::Vec2 { default } => Value::Vec2(*default),
            Self::Vec3 { default } => Value::Vec3(*default),
            Self::Vec4 { default } => Value::Vec4(*default),
        }
    }
}

const fn port_shape(ty: &EdgeType) -> PortShape {
    match ty {
        EdgeType::Image(_) => PortShape::Image,
        EdgeType::Volume(_) => PortShape::Volume,
        EdgeType::Table(TableType { element: Element::U32, .. }) => PortShape::Uints,
        EdgeType::Table(_) => PortShape::Floats,
        EdgeType::Scalar(_) | EdgeType::Mesh(_) => PortShape::Scalar,
    }
}

impl Wgsl {
    fn entry(&self) -> (Entry, &'static str) {
        match self.access {
            Access::Point => (Entry::Point, "apply"),
            Access::Kernel => (Entry::Kernel, "main"),
            Access::Around(_) | Access::Whole if self.outputs.len() > 1 => (Entry::Each, "each"),
            Access::Around(_) | Access::Whole => (Entry::At, "at"),
        }
    }

    /// What the shader defines, given the types of its inputs and of its first output.
    fn signature(&self, inputs: &[EdgeType], output: &EdgeType) -> Option<Signature> {
        let (at, value): (&'static [&'static str], _) = match port_shape(output) {
            PortShape::Image => (&["vec2i"], "vec4f"),
            PortShape::Volume => (&["vec3i"], "vec4f"),
            PortShape::Floats => (&["i32"], "f32"),
            PortShape::Uints => (&["i32"], "u32"),
            PortShape::Scalar => (&["i32"], "vec4f"),
        };
        let (entry, name) = self.entry();
        match entry {
            Entry::Point => {
                let images = inputs.iter().filter(|ty| matches!(ty, EdgeType::Image(_))).count();
                Some(Signature { name, arguments: vec![&["vec4f"]; images], result: Some("vec4f") })
            }
            Entry::At => Some(Signature { name, arguments: vec![at], result: Some(value) }),
            Entry::Each => Some(Signature { name, arguments: vec![&["vec2i", "vec3i", "i32"]], result: None }),
            _ => None,
        }
    }

    const fn reach(&self) -> Reach {
        match self.access {
            Access::Point => Reach::Point,
            Access::Around(n) => Reach::Around(n, n),
            Access::Whole | Access::Kernel => Reach::Whole,
        }
    }

    fn output_type(&self, name: &str, port: &PortType, inputs: &Inputs<'_>) -> Result<EdgeType, Mistake> {
        let wrong = |message: String| Mistake::in_field("outputs", format!("`{name}` {message}"));
        let like = |like: &Option<String>| -> Result<Option<EdgeType>, Mistake> {
            match like {
                None => Ok(None),
                Some(input) => match self.inputs.get(input) {
                    Some(edge) => Ok(Some(inputs.ty(edge.edge))),
                    None => Err(wrong(format!("is like `{input}`, which is no input of this node"))),
                },
            }
        };
        match port {
            PortType::Image { like: from, size, channels, format } => {
                let model = match (like(from)?, size) {
                    (Some(EdgeType::Image(t)), size) => t.with_size(size.unwrap_or(t.size)),
                    (Some(_), _) => return Err(wrong("is an image like an input that is none".into())),
                    (None, Some(size)) => ImageType::new(*size, 4),
                    (None, None) => return Err(wrong("has no size".into()).hint("expected `like: \"INPUT\"` or `size: (w, h)`")),
                };
                let channels = channels.unwrap_or(model.channels);
                if !matches!(channels, 1 | 2 | 4) {
                    return Err(wrong(format!("has {channels} channels; expected 1, 2 or 4")));
                }
                if model.size.contains(&0) {
                    return Err(wrong("has no pixels".into()));
                }
                Ok(EdgeType::Image(ImageType { channels, precision: format.unwrap_or(model.precision), ..model }))
            }
            PortType::Volume { like: from, size, channels } => {
                let (model, own) = match (like(from)?, size) {
                    (Some(EdgeType::Volume(t)), size) => (size.unwrap_or(t.size), t.channels),
                    (Some(_), _) => return Err(wrong("is a volume like an input that is none".into())),
                    (None, Some(size)) => (*size, 1),
                    (None, None) => return Err(wrong("has no size".into())),
                };
                let channels = channels.unwrap_or(own);
                if !matches!(channels, 1 | 4) || model.contains(&0) {
                    return Err(wrong("needs a size and 1 or 4 channels".into()));
                }
                Ok(EdgeType::volume(model, channels))
            }
            PortType::Table { len: 0, .. } => Err(wrong("has no entries".into())),
            PortType::Table { len, element } => Ok(EdgeType::table(*len, *element)),
            PortType::Scalar { components: c @ 1..=4 } => Ok(EdgeType::scalar(*c)),
            PortType::Scalar { .. } => Err(wrong("has 1 to 4 components".into())),
        }
    }
}

/// Longest shader.
const MOST_BYTES: usize = 1 << 24;

impl Node for Wgsl {
    fn open(&mut self, cx: &Opening<'_>) -> Result<(), Mistake> {
        if self.outputs.is_empty() {
            return Err(Mistake::new("has no outputs").hint("expected `outputs: {\"out\": Image(like: \"INPUT\")}`"));
        }
        let path = cx.folder.join(&self.shader);
        let text = cx.loader.text(&path, MOST_BYTES).map_err(|reason| Mistake::in_field("shader", format!("cannot be read: {reason}")))?;
        let (_, function) = self.entry();
        if !defines(&text, function) {
            return Err(Mistake::in_field("shader", format!("defines no `fn {function}`")).hint(format!(
                "with access {:?} and {} output(s) the shader defines `{function}`",
                self.access,
                self.outputs.len()
            )));
        }
        if self.access == Access::Point && self.outputs.len() > 1 {
            return Err(Mistake::in_field("access", "is Point, which has one output").hint("use Around(0) and `fn each(xy: vec2i)`"));
        }
        self.source = Some(Shader::user(&path.display().to_string(), &text));
        Ok(())
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let mut outputs = Vec::new();
        for (name, port) in &self.outputs {
            outputs.push(Output::new(name.clone(), self.output_type(name, port, inputs)?));
        }
        if matches!(self.access, Access::Point | Access::Around(_)) {
            let images = self.inputs.iter().filter_map(|(name, port)| match inputs.ty(port.edge) {
                EdgeType::Image(t) => Some((name, t.size)),
                _ => None,
            });
            for (name, size) in images {
                if let EdgeType::Image(out) = outputs[0].ty
                    && out.size != size
                {
                    return Err(Mistake::in_field(
                        format!("inputs.{name}"),
                        format!("is {}x{}, the output is {}x{}", size[0], size[1], out.size[0], out.size[1]),
                    )
                    .hint("with access Point or Around all images have the output's size; use Whole"));
                }
            }
        }
        let Some(shader) = &self.source else { return Ok(outputs) };
        let params: Vec<_> = self.params.iter().map(|(name, p)| (name.clone(), p.wgsl())).collect();
        let mut stubs = common_stubs(&params);
        for (name, port) in &self.inputs {
            stubs.push_str(&port_stub(name, port_shape(&inputs.ty(port.edge)), true));
        }
        for output in &outputs {
            stubs.push_str(&port_stub(&output.name, port_shape(&output.ty), false));
        }
        let types: Vec<EdgeType> = self.inputs.values().map(|port| inputs.ty(port.edge)).collect();
        let signature = self.signature(&types, &outputs[0].ty);
        wgsl::check(&shader.path, &shader.source, &stubs, LIBRARY, signature.as_ref())
            .map_err(|message| Mistake::in_field("shader", format!("does not compile:\n{message}")))?;
        Ok(outputs)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let mut shader = self.source.clone().ok_or_else(|| Mistake::new("was not opened"))?;
        let (mut entry, _) = self.entry();
        let grid = match (entry, self.groups) {
            (Entry::Kernel, Some(groups)) => Grid::Groups(groups),
            (Entry::Kernel, None) => {
                let size = workgroup_size(&shader.source).ok_or_else(|| {
                    Mistake::in_field("shader", "says no workgroup size in numbers").hint("write `@workgroup_size(8, 8)`, or give `groups`")
                })?;
                let first = self.outputs.keys().next().map(|n| cx.output_type(n));
                let cover = match first {
                    Some(EdgeType::Image(t)) => [t.size[0], t.size[1], 1],
                    Some(EdgeType::Volume(t)) => t.size,
                    Some(EdgeType::Table(t)) => [t.len, 1, 1],
                    _ => [1; 3],
                };
                Grid::Groups(std::array::from_fn(|i| cover[i].div_ceil(size[i])))
            }
            _ => Grid::Cover,
        };
        if let Some(mut bounded) = wgsl::bounded(&shader.source) {
            if entry == Entry::Point && cx.limits().profile == Profile::Cpu {
                // Fused, a thread would make several pixels, with the rounds of one.
                let images = self.inputs.iter().filter(|(_, port)| matches!(cx.ty(port.edge), EdgeType::Image(_)));
                let loads: Vec<String> = images.map(|(name, _)| format!("load_{name}(xy)")).collect();
                bounded.push_str(&format!("\nfn at(xy: vec2i) -> vec4f {{ return apply({}); }}\n", loads.join(", ")));
                entry = Entry::At;
            }
            shader.source = bounded.into();
        }
        let inputs: Vec<_> = self.inputs.iter().map(|(name, port)| (name, cx.input(port))).collect();
        let outputs: Vec<_> = self.outputs.keys().map(|name| (name.clone(), cx.output(name))).collect();
        let params: Vec<_> = self.params.iter().map(|(name, p)| (name, p.value(cx))).collect();
        let reach = self.reach();
        let mut pass = cx.pass("", shader).entry(entry).grid(grid);
        for (name, id) in inputs {
            pass = pass.read(name, id, reach);
        }
        for (name, id) in outputs {
            pass = pass.write(&name, id);
        }
        for (name, value) in params {
            pass = pass.param(name, value);
        }
        pass.add();
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        unreachable!("a user's shader has no twin")
    }
}
