//! What a user's shader must be beside valid WGSL: what it defines has the shape that is called, it declares no bindings,
//! and it is content with the memory that every device has.

use std::ops::Range;

use naga::{AddressSpace, Function, Module, ScalarKind, Span, TypeInner, VectorSize};

/// Bytes of one variable, and of all workgroup memory: what every device gives. Drivers take minutes over larger arrays.
const MOST_BYTES: u32 = 16 << 10;

/// Threads of a workgroup, likewise.
const MOST_THREADS: u32 = 256;

/// The function that a shader defines.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signature {
    /// Its name.
    pub name: &'static str,
    /// The types that each argument may have.
    pub arguments: Vec<&'static [&'static str]>,
    /// The type of its result; `None` where it answers nothing.
    pub result: Option<&'static str>,
}

impl Signature {
    /// As it should be written.
    fn text(&self) -> String {
        let name = |i: usize| if self.arguments.len() == 1 { "xy".to_owned() } else { format!("a{i}") };
        let arguments: Vec<String> = self.arguments.iter().enumerate().map(|(i, types)| format!("{}: {}", name(i), types[0])).collect();
        let result = self.result.map(|ty| format!(" -> {ty}")).unwrap_or_default();
        format!("fn {}({}){result}", self.name, arguments.join(", "))
    }
}

type Mistake = (String, Option<Range<usize>>);

fn mistake(message: String, span: Span) -> Result<(), Mistake> {
    Err((message, span.to_range()))
}

/// The first rule that the user's part of a module, up to byte `end`, breaks.
pub(super) fn check(module: &Module, end: usize, signature: Option<&Signature>) -> Result<(), Mistake> {
    let own = |span: &Span| span.to_range().is_some_and(|place| place.start < end);
    let mut layouter = naga::proc::Layouter::default();
    let known = layouter.update(module.to_ctx()).is_ok();
    let bytes = |ty| if known { layouter[ty].size } else { u32::MAX };
    let mut shared = 0_u32;
    for (handle, global) in module.global_variables.iter() {
        let span = module.global_variables.get_span(handle);
        if !own(&span) {
            continue;
        }
        let name = global.name.as_deref().unwrap_or_default();
        let size = bytes(global.ty);
        match global.space {
            _ if global.binding.is_some() => {
                return mistake(
                    format!("`{name}` is a binding; a shader declares none, its ports are functions such as `load_NAME`"),
                    span,
                );
            }
            AddressSpace::WorkGroup => {
                shared = shared.saturating_add(size);
                if shared > MOST_BYTES {
                    return mistake(format!("`{name}` makes it {shared} bytes of workgroup memory; there are {MOST_BYTES}"), span);
                }
            }
            AddressSpace::Private => small(name, size, span)?,
            _ => return mistake(format!("`{name}` is neither private nor of the workgroup"), span),
        }
    }
    for (handle, function) in module.functions.iter().filter(|(handle, _)| own(&module.functions.get_span(*handle))) {
        locals(function, &bytes)?;
        if let Some(signature) = signature.filter(|s| function.name.as_deref() == Some(s.name)) {
            shape(module, function, signature).map_err(|message| (message, module.functions.get_span(handle).to_range()))?;
        }
    }
    for entry in &module.entry_points {
        locals(&entry.function, &bytes)?;
        let threads = entry.workgroup_size.iter().fold(1_u32, |all, n| all.saturating_mul(*n));
        if threads > MOST_THREADS {
            return Err((
                format!("a workgroup of `{}` has {threads} threads; at most {MOST_THREADS} are everywhere possible", entry.name),
                None,
            ));
        }
    }
    Ok(())
}

fn small(name: &str, bytes: u32, span: Span) -> Result<(), Mistake> {
    if bytes > MOST_BYTES {
        return mistake(format!("`{name}` takes {bytes} bytes a thread; at most {MOST_BYTES} are everywhere possible"), span);
    }
    Ok(())
}

fn locals(function: &Function, bytes: &dyn Fn(naga::Handle<naga::Type>) -> u32) -> Result<(), Mistake> {
    let all = function.local_variables.iter();
    all.map(|(handle, local)| (local, function.local_variables.get_span(handle)))
        .try_for_each(|(local, span)| small(local.name.as_deref().unwrap_or_default(), bytes(local.ty), span))
}

/// Whether a function has this signature.
fn shape(module: &Module, function: &Function, wanted: &Signature) -> Result<(), String> {
    let arguments: Vec<String> = function.arguments.iter().map(|argument| name(module, argument.ty)).collect();
    let result = function.result.as_ref().map(|result| name(module, result.ty));
    let fits = arguments.len() == wanted.arguments.len()
        && arguments.iter().zip(&wanted.arguments).all(|(is, may)| may.contains(&is.as_str()))
        && result.as_deref() == wanted.result;
    if fits {
        return Ok(());
    }
    let result = result.map(|ty| format!(" -> {ty}")).unwrap_or_default();
    Err(format!("`{}` is ({}){result}; expected `{}`", wanted.name, arguments.join(", "), wanted.text()))
}

/// The name of a type.
fn name(module: &Module, ty: naga::Handle<naga::Type>) -> String {
    let short = |scalar: naga::Scalar| match (scalar.kind, scalar.width) {
        (ScalarKind::Float, 4) => "f",
        (ScalarKind::Sint, 4) => "i",
        (ScalarKind::Uint, 4) => "u",
        _ => "?",
    };
    let ty = &module.types[ty];
    match &ty.inner {
        TypeInner::Scalar(scalar) if scalar.kind == ScalarKind::Bool => "bool".to_owned(),
        TypeInner::Scalar(scalar) => format!("{}32", short(*scalar)),
        TypeInner::Vector { size, scalar } => {
            let n = match size {
                VectorSize::Bi => 2,
                VectorSize::Tri => 3,
                VectorSize::Quad => 4,
            };
            format!("vec{n}{}", short(*scalar))
        }
        _ => ty.name.clone().unwrap_or_else(|| "another type".to_owned()),
    }
}
