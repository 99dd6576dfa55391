//! What can be said of a shader by its words alone, before anything parses it: comments are left out.

use std::ops::Range;

/// A call that stands in every loop of a user's shader. The composer defines it: it counts, and answers `true` when there
/// have been too many rounds.
pub(super) const TOO_LONG: &str = "pipe_too_long";

/// A word, or a single character of anything else but space.
pub(super) struct Token<'t> {
    pub(super) text: &'t str,
    pub(super) at: usize,
}

impl Token<'_> {
    pub(super) fn place(&self) -> Range<usize> {
        self.at..self.at + self.text.len()
    }
}

/// The words of a shader in order.
pub(super) fn tokens(text: &str) -> Vec<Token<'_>> {
    let bytes = text.as_bytes();
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(c) = text.get(at..).and_then(|rest| rest.chars().next()) {
        let rest = &text[at..];
        let length = if rest.starts_with("//") {
            at += rest.find('\n').unwrap_or(rest.len());
            continue;
        } else if rest.starts_with("/*") {
            at += comment(&bytes[at..]);
            continue;
        } else if c.is_alphabetic() || c == '_' {
            rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len())
        } else if c.is_ascii_digit() {
            rest.find(|c: char| !c.is_alphanumeric()).unwrap_or(rest.len())
        } else {
            c.len_utf8()
        };
        if !c.is_whitespace() {
            tokens.push(Token { text: &rest[..length], at });
        }
        at += length;
    }
    tokens
}

/// The length of a comment that begins here; comments nest.
fn comment(bytes: &[u8]) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at + 1 < bytes.len() {
        match &bytes[at..at + 2] {
            b"/*" => depth += 1,
            b"*/" => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return at;
        }
    }
    bytes.len()
}

/// The shader with a way out of every loop, by a call of `pipe_too_long()`, which the composer defines; `None` where it has
/// no loops. Lines keep their numbers.
pub fn bounded(text: &str) -> Option<String> {
    let tokens = tokens(text);
    let mut out = String::with_capacity(text.len() + 256);
    let mut copied = 0;
    for (i, token) in tokens.iter().enumerate().filter(|(_, token)| matches!(token.text, "for" | "while" | "loop")) {
        // No expression has a brace: the next one begins the body.
        let body = tokens[i..].iter().find(|token| token.text == "{")?;
        // A loop without a round counts too: some drivers see one.
        out.push_str(&text[copied..token.at]);
        out.push_str(&format!("{TOO_LONG}(); {} if {TOO_LONG}() {{ break; }} ", &text[token.at..=body.at]));
        copied = body.at + 1;
    }
    if copied == 0 {
        return None;
    }
    out.push_str(&text[copied..]);
    Some(out)
}

/// What a shader may not say, with its place; `known` are the modules that it may import from.
pub(super) fn forbidden(text: &str, known: &[(&str, &str)]) -> Option<(String, Range<usize>)> {
    let tokens = tokens(text);
    for (i, token) in tokens.iter().enumerate() {
        let what = match token.text {
            "discard" | "dpdx" | "dpdy" | "fwidth" | "dpdxCoarse" | "dpdxFine" | "dpdyCoarse" | "dpdyFine" | "fwidthCoarse"
            | "fwidthFine" => "belongs to fragment shaders; a pass computes",
            "enable" | "requires" if starts_line(&tokens, i) => "asks for an extension; a shader for every device has none",
            "override" if starts_line(&tokens, i) => "is set by nobody; use `params` of the node, or `const`",
            TOO_LONG => "is a name that pipe uses itself",
            "import" if starts_line(&tokens, i) => {
                if let Some(mistake) = import(&tokens[i + 1..], known) {
                    return Some(mistake);
                }
                continue;
            }
            _ => continue,
        };
        return Some((format!("`{}` {what}", token.text), token.place()));
    }
    None
}

/// The modules that a shader imports from, and those that they do: no name of any other is taken.
pub(super) fn imported<'l>(text: &str, known: &[(&str, &'l str)]) -> Vec<&'l str> {
    let named = |text: &str| -> Vec<usize> {
        let words = tokens(text);
        // `lib`, two colons, the module.
        let modules = words.windows(4).filter(|w| w[0].text == "lib" && w[1].text == ":" && w[2].text == ":").map(|w| w[3].text);
        modules.filter_map(|module| known.iter().position(|(name, _)| *name == module)).collect()
    };
    let mut found = named(text);
    let mut at = 0;
    while let Some(module) = found.get(at) {
        for further in named(known[*module].1) {
            if !found.contains(&further) {
                found.push(further);
            }
        }
        at += 1;
    }
    found.sort_unstable();
    found.dedup();
    found.into_iter().map(|module| known[module].1).collect()
}

/// Whether a declaration may begin here.
fn starts_line(tokens: &[Token<'_>], i: usize) -> bool {
    i == 0 || matches!(tokens[i - 1].text, ";" | "}")
}

/// What is wrong with `package::lib::MODULE::NAME;` or `…::{NAME, NAME};`.
fn import(tokens: &[Token<'_>], known: &[(&str, &str)]) -> Option<(String, Range<usize>)> {
    let end = tokens.iter().position(|token| token.text == ";").unwrap_or(tokens.len());
    let words: Vec<&Token<'_>> = tokens[..end].iter().filter(|token| token.text != ":").collect();
    let [package, lib, module, names @ ..] = words.as_slice() else {
        let place = words.first().map_or(0..0, |word| word.place());
        return Some(("an import is `package::lib::MODULE::NAME`".to_owned(), place));
    };
    if (package.text, lib.text) != ("package", "lib") {
        return Some((
            format!("nothing is found at `{}::{}`; shared functions are in `package::lib`", package.text, lib.text),
            package.place(),
        ));
    }
    let Some((_, source)) = known.iter().find(|(name, _)| *name == module.text) else {
        let hint = crate::diagnostic::nearest(module.text, known.iter().map(|(name, _)| *name));
        let hint = hint.map(|name| format!("; did you mean `{name}`?")).unwrap_or_default();
        return Some((format!("`package::lib` has no module `{}`{hint}", module.text), module.place()));
    };
    let defined = self::tokens(source);
    let is_there = |name: &str| {
        let mut pairs = defined.windows(2);
        pairs.any(|pair| matches!(pair[0].text, "fn" | "const" | "struct" | "alias") && pair[1].text == name)
    };
    // After `as` comes a name of the user's own.
    let mut own = false;
    for name in names {
        match name.text {
            "{" | "}" | "," => {}
            "as" => own = true,
            _ if own => own = false,
            text if !is_there(text) => return Some((format!("`package::lib::{}` has no `{text}`", module.text), name.place())),
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_loop_has_a_way_out() {
        let text = "// for {\nfn f() {\n  for (var i = 0; i < 3; i++) { a(); }\n  while x /* { */ < 2 { loop { b(); } }\n}\n";
        let bounded = bounded(text).expect("it has loops");
        assert_eq!(bounded.matches("{ if pipe_too_long() { break; } ").count(), 3, "{bounded}");
        assert_eq!(bounded.lines().count(), text.lines().count());
        assert_eq!(super::bounded("fn forward(loops: i32) {} /* for { /* */ } */"), None);
    }

    #[test]
    fn modules_bring_those_that_they_import() {
        let known = [("a", "import package::lib::b::f;\nA"), ("b", "import package::lib::a::g;\nB"), ("c", "C")];
        let ends = |text: &str| imported(text, &known).iter().map(|module| &module[module.len() - 1..]).collect::<String>();
        assert_eq!(ends("import package::lib::a::{g, h};\nfn total() {}"), "AB");
        assert_eq!(ends("// import package::lib::c::x;\nfn at() {}"), "");
    }

    #[test]
    fn imports_are_of_what_there_is() {
        let known = [("color", "fn luminance(c: vec3f) -> f32 { return c.r; }")];
        let message = |text: &str| forbidden(text, &known).map(|(message, place)| (message, text[place].to_owned()));
        assert_eq!(message("import package::lib::color::luminance;\nimport package::lib::color::{luminance as y};"), None);
        let (text, at) = message("import package::lib::colour::luminance;").expect("it is misspelt");
        assert_eq!((text.as_str(), at.as_str()), ("`package::lib` has no module `colour`; did you mean `color`?", "colour"));
        assert!(message("import super::x;").is_some());
        assert!(message("import package::lib::color::{luminance, hue};").is_some_and(|(text, _)| text.ends_with("has no `hue`")));
        assert!(message("enable f16;\nfn at() {}").is_some());
        assert_eq!(message("fn at() { let enable_ = 1; }"), None);
    }
}
