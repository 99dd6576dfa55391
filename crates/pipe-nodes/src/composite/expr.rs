//! `Expr`: every channel by a formula.

use pipe_graph::expr;
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

/// Computes each channel by an expression over the pixels of up to three images: `a.r`, `a.g`, `a.b`, `a.a`, `b.r` …
/// `c.a`, the pixel index `x`, `y` (from 0, the upper left) and `width`, `height`. There are numbers, `pi`, `e`,
/// `+ - * / % ^`, `< <= > >= == !=` (1 or 0), `&& || !`, and min max floor ceil round fract abs sign sqrt exp log sin cos tan
/// pow clamp mix step if; min and max take two arguments or more. Becomes GPU code that fuses with its neighbours.
///
/// A channel without an expression is that of `a`. The result has the channels of `a`, or four when `green`, `blue` or
/// `alpha` is given and `a` has none.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Expr {
    /// The first image.
    a: In<Image>,
    /// The second image, of the same size.
    b: Option<In<Image>>,
    /// The third image, of the same size.
    c: Option<In<Image>>,
    /// Red, and the value of a 1-channel image, such as `"a.r * 0.5 + b.r"`.
    red: Option<String>,
    /// Green.
    green: Option<String>,
    /// Blue.
    blue: Option<String>,
    /// Alpha.
    alpha: Option<String>,
}

pub(crate) const KIND: Kind = Kind::of::<Expr>(
    "Expr",
    Category::Composite,
    &[
        r#"Expr(a: "in", red: "1 - a.r", green: "1 - a.g", blue: "1 - a.b")"#,
        r#"Expr(a: "in", b: "other", c: "grey", red: "mix(a.r, b.r, c.r)", green: "max(a.g, b.g) - min(a.g, c.g)", blue: "(a.b + b.b) / 2", alpha: "clamp(a.a + b.a, 0, 1)")"#,
        r#"Expr(a: "grey", red: "a.r * (x + 0.5) / width - y / height")"#,
        r#"Expr(a: "grey", red: "x % 2 == y % 2", green: "if(x < width / 2 && !(y > 3), 1, 0.25)", blue: "sin(x * 0.1) * cos(y * 0.1)", alpha: "1")"#,
        r#"Expr(a: "in", b: "other", red: "sqrt(abs(a.r)) ^ 0.5", green: "a.g ^ 3 + (-2) ^ 2 ^ 3", blue: "exp(-abs(b.b)) + log(1 + abs(a.b))")"#,
        r#"Expr(a: "pair", red: "floor(a.r * 4) + ceil(a.g) + round(x / 3)", green: "fract(x / 8) + sign(a.r) + step(0.5, y / height) + tan(0.5) + pow(2, 0.5) + pi - e")"#,
        r#"Expr(a: "in", alpha: "a.a * (a.r != b.r || x >= 3) - (y <= 2)", b: "grey")"#,
    ],
)
// Devices compute powers, exp, log and trigonometric functions to a few units of the sixth digit.
.tolerance(1e-5, 1e-4);

const CHANNELS: [&str; 4] = ["red", "green", "blue", "alpha"];
const PASS_THROUGH: [&str; 4] = ["a.r", "a.g", "a.b", "a.a"];

impl Expr {
    fn images(&self) -> Vec<(&'static str, In<Image>)> {
        let images = [("a", Some(self.a)), ("b", self.b), ("c", self.c)];
        images.into_iter().filter_map(|(name, port)| port.map(|port| (name, port))).collect()
    }

    /// The text of each channel; a leading `=`, as in parameters, may stand there.
    fn texts(&self) -> [&str; 4] {
        let given = [&self.red, &self.green, &self.blue, &self.alpha];
        std::array::from_fn(|i| given[i].as_deref().map_or(PASS_THROUGH[i], |text| text.strip_prefix('=').unwrap_or(text)))
    }

    fn parsed(&self) -> Result<[expr::Expr; 4], Mistake> {
        let [r, g, b, a] = self.texts();
        let parse = |i: usize, text: &str| expr::Expr::parse(text).map_err(|e| mistake(i, text, &e));
        Ok([parse(0, r)?, parse(1, g)?, parse(2, b)?, parse(3, a)?])
    }

    /// What a name is called in WGSL, if it means something here.
    fn resolve(&self, name: &str) -> Option<String> {
        let place = match name {
            "x" => "f32(pixel().x)",
            "y" => "f32(pixel().y)",
            "width" => "f32(size_out().x)",
            "height" => "f32(size_out().y)",
            _ => {
                let (image, channel) = name.split_once('.')?;
                let known = self.images().iter().any(|(known, _)| *known == image) && matches!(channel, "r" | "g" | "b" | "a");
                return known.then(|| name.to_owned());
            }
        };
        Some(place.to_owned())
    }

    /// The shader.
    fn source(&self) -> Result<String, Mistake> {
        let texts = self.texts();
        let mut channels = Vec::new();
        for (i, parsed) in self.parsed()?.iter().enumerate() {
            let text = parsed.to_wgsl(&mut |name| self.resolve(name)).map_err(|e| self.unknown_name(mistake(i, texts[i], &e)))?;
            channels.push(runtime_literals(&text));
        }
        let arguments: Vec<String> = self.images().iter().map(|(name, _)| format!("{name}: vec4f")).collect();
        Ok(format!(
            "import package::lib::power::real_power;\n\n\
             fn expr_pow(x: f32, y: f32) -> f32 {{ return real_power(x, y); }}\n\
             fn number(v: f32) -> f32 {{ return v; }}\n\n\
             fn apply({}) -> vec4f {{\n    return vec4f(\n        {},\n    );\n}}\n",
            arguments.join(", "),
            channels.join(",\n        "),
        ))
    }

    fn unknown_name(&self, mistake: Mistake) -> Mistake {
        if mistake.hint.is_some() {
            return mistake;
        }
        let images: Vec<String> = self.images().iter().map(|(name, _)| format!("{name}.r {name}.g {name}.b {name}.a")).collect();
        mistake.hint(format!("known: {} x y width height", images.join(" ")))
    }
}

/// The mistake in the expression of a channel, with the text at fault.
fn mistake(channel: usize, text: &str, e: &expr::ExprError) -> Mistake {
    let at = text.get(e.range.clone()).filter(|at| !at.is_empty());
    let message = match at {
        Some(at) if !e.message.contains(at) => format!("{}: `{at}`", e.message),
        _ => e.message.clone(),
    };
    let mistake = Mistake::in_field(CHANNELS[channel], message);
    match &e.hint {
        Some(hint) => mistake.hint(hint),
        None => mistake,
    }
}

/// Hides literals behind a function. A shader whose constants divide by zero or overflow is refused; values that are
/// computed when it runs may do so.
fn runtime_literals(text: &str) -> String {
    let mut out = String::with_capacity(text.len() * 2);
    let mut rest = text;
    let mut before = ' ';
    while let Some(c) = rest.chars().next() {
        let length =
            if c.is_ascii_digit() && !(before.is_ascii_alphanumeric() || before == '_' || before == '.') { literal(rest) } else { 0 };
        if length > 0 {
            out.push_str("number(");
            out.push_str(&rest[..length]);
            out.push(')');
            rest = &rest[length..];
            before = ')';
        } else {
            out.push(c);
            rest = &rest[c.len_utf8()..];
            before = c;
        }
    }
    out
}

/// Length of the f32 literal that a text begins with; 0 when there is none.
fn literal(text: &str) -> usize {
    let bytes = text.as_bytes();
    let mut i = 0;
    while i < bytes.len() {
        match bytes[i] {
            b'0'..=b'9' | b'.' | b'e' => {}
            b'+' | b'-' if i > 0 && bytes[i - 1] == b'e' => {}
            b'f' => return i + 1,
            _ => return 0,
        }
        i += 1;
    }
    0
}

impl Node for Expr {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        self.source().map(drop)
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let images = self.images();
        let ports: Vec<_> = images.iter().map(|(name, port)| (*name, port)).collect();
        inputs.same_size(&ports)?;
        let a = inputs.image(&self.a);
        let needed = match (&self.green, &self.blue, &self.alpha) {
            (None, None, None) => 1,
            (Some(_), None, None) => 2,
            _ => 4,
        };
        // Two channels are a pair of fields and not a colour: only an `a` of two stays one.
        let channels = if needed <= a.channels { a.channels } else { 4 };
        Ok(Output::out(EdgeType::Image(a.with_channels(channels))))
    }

    fn makes_alpha(&self) -> bool {
        self.alpha.as_deref().is_some_and(|alpha| !matches!(alpha.trim(), "1" | "1.0"))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let images: Vec<_> = self.images().into_iter().map(|(name, port)| (name, cx.input(&port))).collect();
        let out = cx.output("out");
        let mut pass = cx.pass("", Shader::builtin("composite/expr.wgsl", &self.source()?)).entry(Entry::Point);
        for (name, image) in images {
            pass = pass.read(name, image, Reach::Point);
        }
        pass.write("out", out).add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let a = cx.image(&self.a);
        let parsed = self.parsed().expect("`open` has checked the expressions");
        let images = self.images();
        let colored = self.blue.is_some() || self.alpha.is_some() || (self.green.is_some() && a.channels == 1);
        let channels = if colored { 4 } else { a.channels };
        let out = Raster::from_fn(a.size, channels, |x, y| {
            let name = |name: &str| match name {
                "x" => Some(x as f64),
                "y" => Some(y as f64),
                "width" => Some(f64::from(a.size[0])),
                "height" => Some(f64::from(a.size[1])),
                _ => {
                    let (image, channel) = name.split_once('.')?;
                    let (_, port) = images.iter().find(|(known, _)| *known == image)?;
                    let channel = ["r", "g", "b", "a"].iter().position(|c| *c == channel)?;
                    Some(cx.image(port).at(x, y)[channel])
                }
            };
            std::array::from_fn(|c| parsed[c].eval_with(&name))
        });
        vec![Tensor::Image(out)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_are_hidden_from_the_shader_compiler() {
        assert_eq!(runtime_literals("(1.0f / (a.r - 1e-7f))"), "(number(1.0f) / (a.r - number(1e-7f)))");
        assert_eq!(runtime_literals("select(0.0, 1.0, f32(pixel().x) > 2.5f)"), "select(0.0, 1.0, f32(pixel().x) > number(2.5f))");
    }

    #[test]
    fn mistakes_name_the_channel() {
        let expr = |red: &str| Expr { red: Some(red.into()), ..Expr::default() }.source().unwrap_err();
        let unknown = expr("a.r * b.r");
        assert_eq!((unknown.field.as_deref(), unknown.message.as_str()), (Some("red"), "unknown name `b.r`"));
        assert!(unknown.hint.is_some_and(|h| h.contains("a.g")));
        assert_eq!(expr("a.r +").field.as_deref(), Some("red"));
        assert_eq!(expr("sqr(a.r)").hint.as_deref(), Some("did you mean `sqrt`?"));
    }
}
