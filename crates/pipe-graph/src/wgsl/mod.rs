//! A user's shader is checked before any device is there, and its mistakes are told at their places in his file.
//!
//! naga parses the user's text followed by what the composer will provide: declarations of the ports as stubs, and the
//! shared library. Because all of that comes behind the user's text, every place that naga names in the text is the
//! user's own.

mod rules;
mod tokens;

use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};

pub use rules::Signature;
use tokens::TOO_LONG;
pub use tokens::bounded;

/// The shared functions of `shaders/lib`, by module name.
pub const LIBRARY: &[(&str, &str)] = &include!(concat!(env!("OUT_DIR"), "/library.rs"));

/// Largest shader that is read, in bytes.
pub const MOST_BYTES: usize = 256 << 10;

/// What a port is to a shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PortShape {
    /// `vec2i` → `vec4f`
    Image,
    /// `vec3i` → `vec4f`
    Volume,
    /// `i32` → `f32`
    Floats,
    /// `i32` → `u32`
    Uints,
    /// → `vec4f`
    Scalar,
}

/// Stubs of the functions that the composer generates for a port.
pub fn port_stub(name: &str, shape: PortShape, input: bool) -> String {
    let mut out = String::new();
    let (at, value) = match shape {
        PortShape::Image => ("vec2i", "vec4f"),
        PortShape::Volume => ("vec3i", "vec4f"),
        PortShape::Floats => ("i32", "f32"),
        PortShape::Uints => ("i32", "u32"),
        PortShape::Scalar => ("", "vec4f"),
    };
    let place = if at.is_empty() { String::new() } else { format!("at: {at}") };
    let comma = if at.is_empty() { "" } else { ", " };
    if !at.is_empty() {
        let _ = writeln!(out, "fn size_{name}() -> {at} {{ return {at}(1); }}");
    }
    if input {
        let _ = writeln!(out, "fn load_{name}({place}) -> {value} {{ return {value}(); }}");
        match shape {
            PortShape::Image => out.push_str(&format!("fn sample_{name}(uv: vec2f) -> vec4f {{ return vec4f(); }}\n")),
            PortShape::Volume => out.push_str(&format!("fn sample_{name}(uvw: vec3f) -> vec4f {{ return vec4f(); }}\n")),
            _ => {}
        }
    } else {
        let _ = writeln!(out, "fn store_{name}({place}{comma}v: {value}) {{ }}");
    }
    out
}

/// Stubs of what every shader sees, beside its ports: parameters as (name, WGSL type).
pub fn common_stubs(params: &[(String, &str)]) -> String {
    let mut out = format!(
        "fn pixel() -> vec2i {{ return vec2i(); }}\n\
         var<private> rounds: u32;\nfn {TOO_LONG}() -> bool {{ rounds += 1u; return rounds > 9u; }}\n"
    );
    if !params.is_empty() {
        let members: String = params.iter().map(|(name, ty)| format!("{name}: {ty}, ")).collect();
        let _ = writeln!(out, "struct Params {{ {members} }}\nvar<private> params: Params;");
    }
    out
}

/// Whether a text is one of [`bounded`].
pub fn is_bounded(text: &str) -> bool {
    text.contains(TOO_LONG)
}

/// Checks a shader that defines `signature`. The error is what a user should read, with `path:line:column` and the line
/// underlined.
pub fn check(path: &str, text: &str, stubs: &str, library: &[(&str, &str)], signature: Option<&Signature>) -> Result<(), String> {
    if text.len() > MOST_BYTES {
        return Err(format!("{path} has {} bytes; a shader may have at most {MOST_BYTES}", text.len()));
    }
    if let Some((message, place)) = tokens::forbidden(text, library) {
        return Err(explain(path, text, &message, Some(place)));
    }
    let mut whole = blank_imports(text);
    whole.push('\n');
    whole.push_str(stubs);
    for module in tokens::imported(text, library) {
        whole.push_str(&blank_imports(module));
        whole.push('\n');
    }
    let (end, signature) = (text.len(), signature.cloned());
    let parse = move || -> Result<(), (String, Option<std::ops::Range<usize>>)> {
        let module = naga::front::wgsl::parse_str(&whole).map_err(|e| {
            let place = e.labels().next().and_then(|(span, _)| span.to_range());
            (e.message().to_owned(), place)
        })?;
        rules::check(&module, end, signature.as_ref())?;
        let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all());
        validator.validate(&module).map(|_| ()).map_err(|e| {
            let mut message = e.as_inner().to_string();
            let mut cause = std::error::Error::source(e.as_inner());
            while let Some(inner) = cause {
                let _ = write!(message, ": {inner}");
                cause = inner.source();
            }
            // The whole function comes first, then what in it is wrong.
            let places = e.spans().filter_map(|(span, _)| span.to_range());
            (message, places.min_by_key(ExactSizeIterator::len))
        })
    };
    // naga recurses over long expressions; a hostile shader must not end the process.
    let checked = std::thread::Builder::new()
        .name("shader check".into())
        .stack_size(256 << 20)
        .spawn(move || catch_unwind(AssertUnwindSafe(parse)))
        .map_err(|e| format!("cannot start a thread: {e}"))?
        .join();
    let found = match checked {
        Ok(Ok(found)) => found,
        Ok(Err(_)) | Err(_) => return Err(format!("{path}: the shader compiler gave up on this shader")),
    };
    found.map_err(|(message, place)| explain(path, text, &message, place))
}

fn explain(path: &str, text: &str, message: &str, place: Option<std::ops::Range<usize>>) -> String {
    let Some(place) = place.filter(|p| p.start < text.len()) else { return format!("{path}: {message}") };
    let line_start = text[..place.start].rfind('\n').map_or(0, |i| i + 1);
    let line = text[line_start..].lines().next().unwrap_or_default();
    let number = text[..line_start].matches('\n').count() + 1;
    let column = text[line_start..place.start].chars().count() + 1;
    let width = text.get(place.start..place.end.min(line_start + line.len())).map_or(1, |t| t.chars().count()).max(1);
    format!(
        "{path}:{number}:{column}: {message}\n  {number} | {line}\n  {} | {}{}",
        " ".repeat(number.to_string().len()),
        " ".repeat(column - 1),
        "^".repeat(width)
    )
}

/// The text with every `import …;` overwritten by spaces, so that places stay.
fn blank_imports(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut inside = false;
    for line in text.split_inclusive('\n') {
        inside |= line.trim_start().starts_with("import ");
        if inside {
            inside = !line.contains(';');
            let text = line.trim_end_matches('\n');
            out.push_str(&" ".repeat(text.len()));
            out.push_str(&line[text.len()..]);
        } else {
            out.push_str(line);
        }
    }
    out
}

/// Whether a function of this name is defined in the text.
pub fn defines(text: &str, name: &str) -> bool {
    let code = text.lines().map(|l| l.split("//").next().unwrap_or_default());
    code.into_iter().any(|l| {
        l.match_indices("fn ").any(|(i, _)| {
            let rest = l[i + 3..].trim_start();
            rest.strip_prefix(name).is_some_and(|r| r.trim_start().starts_with('('))
        })
    })
}

/// The numbers of `@workgroup_size(x, y, z)`.
pub fn workgroup_size(text: &str) -> Option<[u32; 3]> {
    let at = text.find("@workgroup_size(")? + "@workgroup_size(".len();
    let inside = &text[at..at + text[at..].find(')')?];
    let mut size = [1; 3];
    for (slot, part) in size.iter_mut().zip(inside.split(',').filter(|p| !p.trim().is_empty())) {
        *slot = part.trim().trim_end_matches(['u', 'i']).parse().ok().filter(|n| *n > 0)?;
    }
    Some(size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_the_users_own() {
        let text = "// glow\nimport package::lib::color::luminance;\n\nfn apply(image: vec4f) -> vec4f {\n    return image * gian;\n}\n";
        let error = check("glow.wgsl", text, &common_stubs(&[("gain".into(), "f32")]), LIBRARY, None).expect_err("gian is unknown");
        assert!(error.starts_with("glow.wgsl:5:20:"), "{error}");
        assert!(error.contains("^^^^"), "{error}");
        let good = text.replace("gian", "params.gain");
        assert_eq!(check("glow.wgsl", &good, &common_stubs(&[("gain".into(), "f32")]), LIBRARY, None), Ok(()));
    }

    #[test]
    fn names_of_modules_that_are_not_imported_are_free() {
        let text = "import package::lib::color::luminance;\nfn total(c: vec4f) -> f32 { return luminance(c.rgb); }\n\
                    fn plus(a: f32) -> f32 { return a; }\nfn apply(image: vec4f) -> vec4f { return vec4f(plus(total(image))); }\n";
        assert_eq!(check("own.wgsl", text, &common_stubs(&[]), LIBRARY, None), Ok(()));
    }

    #[test]
    fn long_chains_do_not_overflow() {
        let text = format!("fn apply(image: vec4f) -> vec4f {{ return image{}; }}", " + image".repeat(20_000));
        let _ = check("long.wgsl", &text, "", &[], None);
    }

    #[test]
    fn what_is_called_has_the_shape_that_it_is_called_with() {
        let at = Signature { name: "at", arguments: vec![&["vec2i"]], result: Some("vec4f") };
        let check = |text: &str| check("a.wgsl", text, &common_stubs(&[]), &[], Some(&at));
        assert_eq!(check("fn at(xy: vec2<i32>) -> vec4<f32> { return vec4f(); }"), Ok(()));
        for (text, message) in [
            ("fn at(xy: vec2u) -> vec4f { return vec4f(); }", "a.wgsl:1:1: `at` is (vec2u) -> vec4f; expected `fn at(xy: vec2i) -> vec4f`"),
            ("fn at(xy: vec2i) -> f32 { return 0.0; }", "a.wgsl:1:1: `at` is (vec2i) -> f32; expected"),
            (
                "@group(0) @binding(0) var t: texture_2d<f32>;\nfn at(xy: vec2i) -> vec4f { return vec4f(); }",
                "a.wgsl:1:23: `t` is a binding",
            ),
            ("fn at(xy: vec2i) -> vec4f { var z: array<vec4f, 2000>; return z[xy.x]; }", "a.wgsl:1:29: `z` takes 32000 bytes"),
            ("var<workgroup> w: array<f32, 100000000>;\nfn at(xy: vec2i) -> vec4f { return vec4f(w[0]); }", "a.wgsl:1:1: `w` makes it"),
        ] {
            let error = check(text).expect_err(text);
            assert!(error.starts_with(message), "{error}");
        }
    }

    #[test]
    fn finds_functions() {
        assert!(defines("fn  at (xy: vec2i) -> vec4f {", "at"));
        assert!(!defines("// fn at(xy)\nfn attach() {}", "at"));
        assert_eq!(workgroup_size("@compute @workgroup_size(8, 8) fn main"), Some([8, 8, 1]));
    }
}
