//! Expressions: `"=0.01*in.width"` in a parameter, and the four channels of an `Expr` node.
//!
//! One grammar (pest, `expr.pest`), one tree, three readings: evaluated in double precision when a graph is
//! resolved, where a division by zero is a mistake with a place; evaluated as IEEE arithmetic for the twin of
//! `Expr`; and printed as WGSL. Comparisons answer 1 or 0; anything but 0 is true.
//!
//! Precedence from loose to tight: `||`, `&&`, comparisons, `+ -`, `* / %`, unary `- !`, `^` (to the right).

use std::ops::Range;

use indexmap::IndexMap;
use pest::Parser as _;
use pest::iterators::Pair;
use pest::pratt_parser::{Assoc, Op, PrattParser};

use crate::diagnostic::nearest;

use grammar::{Grammar, Rule};

/// What pest generates.
#[allow(missing_docs, unreachable_pub)]
mod grammar {
    #[derive(pest_derive::Parser)]
    #[grammar = "expr.pest"]
    pub(super) struct Grammar;
}

/// Longest expression, in bytes.
const MOST_BYTES: usize = 4096;

/// Deepest nesting of parentheses and calls.
const MOST_DEPTH: usize = 64;

/// What is wrong with an expression, and where in its text.
#[derive(Debug, Clone, PartialEq)]
pub struct ExprError {
    /// Bytes of the expression's text.
    pub range: Range<usize>,
    /// What is wrong.
    pub message: String,
    /// What was expected, or the next step.
    pub hint: Option<String>,
}

impl ExprError {
    fn new(range: Range<usize>, message: impl Into<String>) -> Self {
        Self { range, message: message.into(), hint: None }
    }

    fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

/// The names that an expression may use.
#[derive(Debug, Clone, Default)]
pub struct Env {
    names: IndexMap<String, f64>,
}

impl Env {
    /// No names.
    pub fn new() -> Self {
        Self::default()
    }

    /// Gives a name a value.
    pub fn set(&mut self, name: &str, value: f64) {
        self.names.insert(name.to_owned(), value);
    }

    /// The value of a name.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.names.get(name).copied()
    }
}

/// A parsed expression.
#[derive(Debug, Clone, PartialEq)]
pub struct Expr {
    range: Range<usize>,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Number(f64),
    Name(String),
    Negate(Box<Expr>),
    Not(Box<Expr>),
    Binary(Operator, Box<Expr>, Box<Expr>),
    Call(&'static Function, Vec<Expr>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Operator {
    Or,
    And,
    Lt,
    Le,
    Gt,
    Ge,
    Eq,
    Ne,
    Add,
    Subtract,
    Multiply,
    Divide,
    Modulo,
    Power,
}

/// A function: its name, its number of arguments, its value, and how WGSL writes it (`$1`, `$2` … stand for the
/// arguments).
#[derive(Debug)]
struct Function {
    name: &'static str,
    arity: usize,
    value: fn(&[f64]) -> f64,
    wgsl: &'static str,
}

impl PartialEq for Function {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// x − y·⌊x/y⌋: the sign of y, as in Python.
fn modulo(x: f64, y: f64) -> f64 {
    x - y * (x / y).floor()
}

const FUNCTIONS: &[Function] = &[
    Function { name: "min", arity: 2, value: |a| a[0].min(a[1]), wgsl: "min($1, $2)" },
    Function { name: "max", arity: 2, value: |a| a[0].max(a[1]), wgsl: "max($1, $2)" },
    Function { name: "floor", arity: 1, value: |a| a[0].floor(), wgsl: "floor($1)" },
    Function { name: "ceil", arity: 1, value: |a| a[0].ceil(), wgsl: "ceil($1)" },
    Function { name: "round", arity: 1, value: |a| a[0].round_ties_even(), wgsl: "round($1)" },
    Function { name: "fract", arity: 1, value: |a| a[0] - a[0].floor(), wgsl: "fract($1)" },
    Function { name: "abs", arity: 1, value: |a| a[0].abs(), wgsl: "abs($1)" },
    Function { name: "sign", arity: 1, value: |a| if a[0] == 0.0 { 0.0 } else { a[0].signum() }, wgsl: "sign($1)" },
    Function { name: "sqrt", arity: 1, value: |a| a[0].sqrt(), wgsl: "sqrt($1)" },
    Function { name: "exp", arity: 1, value: |a| a[0].exp(), wgsl: "exp($1)" },
    Function { name: "log", arity: 1, value: |a| a[0].ln(), wgsl: "log($1)" },
    Function { name: "sin", arity: 1, value: |a| a[0].sin(), wgsl: "sin($1)" },
    Function { name: "cos", arity: 1, value: |a| a[0].cos(), wgsl: "cos($1)" },
    Function { name: "tan", arity: 1, value: |a| a[0].tan(), wgsl: "tan($1)" },
    Function { name: "pow", arity: 2, value: |a| a[0].powf(a[1]), wgsl: "expr_pow($1, $2)" },
    Function { name: "clamp", arity: 3, value: |a| a[0].max(a[1]).min(a[2]), wgsl: "min(max($1, $2), $3)" },
    Function { name: "mix", arity: 3, value: |a| a[0] * (1.0 - a[2]) + a[1] * a[2], wgsl: "mix($1, $2, $3)" },
    Function { name: "step", arity: 2, value: |a| f64::from(u8::from(a[1] >= a[0])), wgsl: "step($1, $2)" },
    Function { name: "if", arity: 3, value: |a| if a[0] == 0.0 { a[2] } else { a[1] }, wgsl: "select($3, $2, ($1) != 0.0)" },
];

fn pratt() -> PrattParser<Rule> {
    PrattParser::new()
        .op(Op::infix(Rule::or, Assoc::Left))
        .op(Op::infix(Rule::and, Assoc::Left))
        .op(Op::infix(Rule::lt, Assoc::Left)
            | Op::infix(Rule::le, Assoc::Left)
            | Op::infix(Rule::gt, Assoc::Left)
            | Op::infix(Rule::ge, Assoc::Left)
            | Op::infix(Rule::eq, Assoc::Left)
            | Op::infix(Rule::ne, Assoc::Left))
        .op(Op::infix(Rule::add, Assoc::Left) | Op::infix(Rule::subtract, Assoc::Left))
        .op(Op::infix(Rule::multiply, Assoc::Left) | Op::infix(Rule::divide, Assoc::Left) | Op::infix(Rule::modulo, Assoc::Left))
        .op(Op::prefix(Rule::negate) | Op::prefix(Rule::not))
        .op(Op::infix(Rule::power, Assoc::Right))
}

impl Expr {
    /// Parses the text behind the `=`.
    pub fn parse(text: &str) -> Result<Self, ExprError> {
        if text.len() > MOST_BYTES {
            return Err(ExprError::new(0..text.len(), format!("the expression has {} characters", text.len()))
                .hint(format!("expected at most {MOST_BYTES}")));
        }
        let (mut depth, mut signs) = (0_usize, 0_usize);
        for (i, c) in text.char_indices() {
            match c {
                '(' => depth += 1,
                ')' => depth = depth.saturating_sub(1),
                _ => {}
            }
            match c {
                '-' | '!' => signs += 1,
                c if c.is_whitespace() => {}
                _ => signs = 0,
            }
            if depth > MOST_DEPTH || signs > MOST_DEPTH {
                return Err(ExprError::new(i..i + 1, "the expression is nested too deep").hint(format!("expected at most {MOST_DEPTH}")));
            }
        }
        let mut pairs = Grammar::parse(Rule::whole, text).map_err(|e| syntax_error(text, &e))?;
        let expression = pairs.next().expect("the grammar's root is one expression");
        build(expression, &pratt(), 0)
    }

    /// The value in the environment of a graph. Division by zero and anything else that is not finite is an error
    /// at the place where it arises.
    pub fn eval(&self, env: &Env) -> Result<f64, ExprError> {
        let value = match &self.kind {
            Kind::Number(v) => *v,
            Kind::Name(name) => env.get(name).or_else(|| constant(name)).ok_or_else(|| {
                let mut e = ExprError::new(self.range.clone(), format!("unknown name `{name}`"));
                if let Some(near) = nearest(name, env.names.keys().map(String::as_str)) {
                    e = e.hint(format!("did you mean `{near}`?"));
                } else if !env.names.is_empty() {
                    let known: Vec<_> = env.names.keys().map(String::as_str).collect();
                    e = e.hint(format!("known names: {}", known.join(", ")));
                }
                e
            })?,
            Kind::Negate(e) => -e.eval(env)?,
            Kind::Not(e) => truth(e.eval(env)? == 0.0),
            Kind::Binary(Operator::And, a, b) => truth(a.eval(env)? != 0.0 && b.eval(env)? != 0.0),
            Kind::Binary(Operator::Or, a, b) => truth(a.eval(env)? != 0.0 || b.eval(env)? != 0.0),
            Kind::Binary(op, a, b) => {
                let (a, b) = (a.eval(env)?, b.eval(env)?);
                if b == 0.0 && matches!(op, Operator::Divide | Operator::Modulo) {
                    return Err(ExprError::new(self.range.clone(), "division by zero"));
                }
                op.apply(a, b)
            }
            Kind::Call(f, args) if f.name == "if" => args[if args[0].eval(env)? == 0.0 { 2 } else { 1 }].eval(env)?,
            Kind::Call(f, args) => {
                let args: Vec<f64> = args.iter().map(|a| a.eval(env)).collect::<Result<_, _>>()?;
                (f.value)(&args)
            }
        };
        if value.is_finite() { Ok(value) } else { Err(ExprError::new(self.range.clone(), format!("the result is {value}"))) }
    }

    /// The value as plain IEEE arithmetic; unknown names are NaN.
    pub fn eval_with(&self, names: &dyn Fn(&str) -> Option<f64>) -> f64 {
        match &self.kind {
            Kind::Number(v) => *v,
            Kind::Name(name) => names(name).or_else(|| constant(name)).unwrap_or(f64::NAN),
            Kind::Negate(e) => -e.eval_with(names),
            Kind::Not(e) => truth(e.eval_with(names) == 0.0),
            Kind::Binary(op, a, b) => op.apply(a.eval_with(names), b.eval_with(names)),
            Kind::Call(f, args) => {
                let args: Vec<f64> = args.iter().map(|a| a.eval_with(names)).collect();
                (f.value)(&args)
            }
        }
    }

    /// The expression as WGSL of type f32. `resolve` says what a name is called there. The text uses
    /// `expr_pow(x, y)`, which the caller defines.
    pub fn to_wgsl(&self, resolve: &mut dyn FnMut(&str) -> Option<String>) -> Result<String, ExprError> {
        Ok(match &self.kind {
            Kind::Number(v) => wgsl_number(*v),
            Kind::Name(name) => match resolve(name) {
                Some(text) => text,
                None => {
                    constant(name).map(wgsl_number).ok_or_else(|| ExprError::new(self.range.clone(), format!("unknown name `{name}`")))?
                }
            },
            Kind::Negate(e) => format!("(-{})", e.to_wgsl(resolve)?),
            Kind::Not(e) => format!("select(0.0, 1.0, {} == 0.0)", e.to_wgsl(resolve)?),
            Kind::Binary(op, a, b) => op.wgsl(&a.to_wgsl(resolve)?, &b.to_wgsl(resolve)?),
            Kind::Call(f, args) => {
                let mut text = f.wgsl.to_owned();
                for (i, arg) in args.iter().enumerate().rev() {
                    text = text.replace(&format!("${}", i + 1), &arg.to_wgsl(resolve)?);
                }
                text
            }
        })
    }

    /// Every name in it, in order of appearance.
    pub fn names(&self) -> Vec<&str> {
        let mut names = Vec::new();
        self.collect_names(&mut names);
        names
    }

    fn collect_names<'e>(&'e self, names: &mut Vec<&'e str>) {
        match &self.kind {
            Kind::Number(_) => {}
            Kind::Name(name) => names.push(name),
            Kind::Negate(e) | Kind::Not(e) => e.collect_names(names),
            Kind::Binary(_, a, b) => {
                a.collect_names(names);
                b.collect_names(names);
            }
            Kind::Call(_, args) => args.iter().for_each(|a| a.collect_names(names)),
        }
    }
}

fn constant(name: &str) -> Option<f64> {
    match name {
        "pi" => Some(std::f64::consts::PI),
        "e" => Some(std::f64::consts::E),
        _ => None,
    }
}

fn truth(b: bool) -> f64 {
    f64::from(u8::from(b))
}

fn wgsl_number(v: f64) -> String {
    // Beyond the range of f32 WGSL would refuse the literal.
    format!("{:?}f", (v as f32).clamp(f32::MIN, f32::MAX))
}

impl Operator {
    fn apply(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Or => truth(a != 0.0 || b != 0.0),
            Self::And => truth(a != 0.0 && b != 0.0),
            Self::Lt => truth(a < b),
            Self::Le => truth(a <= b),
            Self::Gt => truth(a > b),
            Self::Ge => truth(a >= b),
            Self::Eq => truth(a == b),
            Self::Ne => truth(a != b),
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
            Self::Modulo => modulo(a, b),
            Self::Power => a.powf(b),
        }
    }

    fn wgsl(self, a: &str, b: &str) -> String {
        let compare = |op: &str| format!("select(0.0, 1.0, {a} {op} {b})");
        match self {
            Self::Or => format!("select(0.0, 1.0, {a} != 0.0 || {b} != 0.0)"),
            Self::And => format!("select(0.0, 1.0, {a} != 0.0 && {b} != 0.0)"),
            Self::Lt => compare("<"),
            Self::Le => compare("<="),
            Self::Gt => compare(">"),
            Self::Ge => compare(">="),
            Self::Eq => compare("=="),
            Self::Ne => compare("!="),
            Self::Add => format!("({a} + {b})"),
            Self::Subtract => format!("({a} - {b})"),
            Self::Multiply => format!("({a} * {b})"),
            Self::Divide => format!("({a} / {b})"),
            Self::Modulo => format!("({a} - {b} * floor({a} / {b}))"),
            Self::Power => format!("expr_pow({a}, {b})"),
        }
    }
}

fn build(pair: Pair<'_, Rule>, pratt: &PrattParser<Rule>, depth: usize) -> Result<Expr, ExprError> {
    let span = |p: &Pair<'_, Rule>| p.as_span().start()..p.as_span().end();
    pratt
        .map_primary(|p| {
            let range = span(&p);
            let kind = match p.as_rule() {
                Rule::number => Kind::Number(p.as_str().parse().map_err(|_| ExprError::new(range.clone(), "this is no number"))?),
                Rule::name => Kind::Name(p.as_str().to_owned()),
                Rule::call => {
                    let mut parts = p.into_inner();
                    let name = parts.next().expect("a call begins with its name");
                    let mut args: Vec<Expr> = parts.map(|a| build(a, pratt, depth + 1)).collect::<Result<_, _>>()?;
                    let Some(f) = FUNCTIONS.iter().find(|f| f.name == name.as_str()) else {
                        let names = FUNCTIONS.iter().map(|f| f.name);
                        let e = ExprError::new(span(&name), format!("there is no function `{}`", name.as_str()));
                        return Err(match nearest(name.as_str(), names) {
                            Some(near) => e.hint(format!("did you mean `{near}`?")),
                            None => e.hint(format!("known: {}", FUNCTIONS.iter().map(|f| f.name).collect::<Vec<_>>().join(" "))),
                        });
                    };
                    let folds = matches!(f.name, "min" | "max");
                    if args.len() < f.arity || (args.len() > f.arity && !folds) {
                        let (name, want, got) = (f.name, f.arity, args.len());
                        let more = if folds { " or more" } else { "" };
                        return Err(ExprError::new(range, format!("`{name}` takes {want} arguments{more}, not {got}")));
                    }
                    // The least of several is the least of two and of the others.
                    while args.len() > f.arity {
                        let two: Vec<Expr> = args.drain(..2).collect();
                        args.insert(0, Expr { range: range.clone(), kind: Kind::Call(f, two) });
                    }
                    Kind::Call(f, args)
                }
                _ => return build(p, pratt, depth + 1),
            };
            Ok(Expr { range, kind })
        })
        .map_prefix(|op, e| {
            let e = e?;
            let range = op.as_span().start()..e.range.end;
            let kind = if op.as_rule() == Rule::negate { Kind::Negate(Box::new(e)) } else { Kind::Not(Box::new(e)) };
            Ok(Expr { range, kind })
        })
        .map_infix(|a, op, b| {
            let (a, b) = (a?, b?);
            let operator = match op.as_rule() {
                Rule::or => Operator::Or,
                Rule::and => Operator::And,
                Rule::lt => Operator::Lt,
                Rule::le => Operator::Le,
                Rule::gt => Operator::Gt,
                Rule::ge => Operator::Ge,
                Rule::eq => Operator::Eq,
                Rule::ne => Operator::Ne,
                Rule::add => Operator::Add,
                Rule::subtract => Operator::Subtract,
                Rule::multiply => Operator::Multiply,
                Rule::divide => Operator::Divide,
                Rule::modulo => Operator::Modulo,
                Rule::power => Operator::Power,
                other => unreachable!("{other:?} is no operator of the grammar"),
            };
            Ok(Expr { range: a.range.start..b.range.end, kind: Kind::Binary(operator, Box::new(a), Box::new(b)) })
        })
        .parse(pair.into_inner())
}

fn syntax_error(text: &str, e: &pest::error::Error<Rule>) -> ExprError {
    let at = match e.location {
        pest::error::InputLocation::Pos(p) => p,
        pest::error::InputLocation::Span((p, _)) => p,
    };
    let message = match text[at..].chars().next() {
        Some(c) => format!("`{c}` does not fit here"),
        None => "the expression ends too early".to_owned(),
    };
    let end = text[at..].chars().next().map_or(at, |c| at + c.len_utf8());
    ExprError::new(at..end, message).hint("expected numbers, names, + - * / % ^, comparisons, functions")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Result<f64, ExprError> {
        let mut env = Env::new();
        env.set("in.width", 640.0);
        env.set("key", 0.18);
        Expr::parse(text)?.eval(&env)
    }

    #[test]
    fn arithmetic() {
        for (text, expected) in [
            ("1 + 2*3", 7.0),
            ("(1+2)*3", 9.0),
            ("-2^2", -4.0),
            ("2^3^2", 512.0),
            ("2^-1", 0.5),
            ("7 % 3", 1.0),
            ("-7 % 3", 2.0),
            ("10 - 2 - 3", 5.0),
            ("0.01*in.width", 6.4),
            ("max(1, min(5, 3))", 3.0),
            ("min(5, 3, 4)", 3.0),
            ("max(1, key, in.width, 2, 3)", 640.0),
            ("clamp(9, 0, 2)", 2.0),
            ("if(key < 0.2, 1, 1/0)", 1.0),
            ("1 < 2 && !(3 <= 2)", 1.0),
            ("1e-3*.5", 0.0005),
            ("cos(pi)", -1.0),
        ] {
            assert_eq!(value(text), Ok(expected), "{text}");
        }
    }

    #[test]
    fn mistakes_have_a_place() {
        let at = |text: &str| value(text).expect_err(text);
        assert_eq!(at("1 + 2/0").range, 4..7);
        assert_eq!(at("kez*2").hint.as_deref(), Some("did you mean `key`?"));
        assert_eq!(at("sqr(2)").hint.as_deref(), Some("did you mean `sqrt`?"));
        assert_eq!(at("2 +").range, 3..3);
        assert!(at("min(1)").message.contains("2 arguments"));
        assert_eq!(at("max(1)").message, "`max` takes 2 arguments or more, not 1");
        assert!(at("log(0-1)").message.contains("NaN"));
        assert!(value(&"(".repeat(5000)).is_err());
        assert!(value(&"-".repeat(4000)).is_err());
    }

    #[test]
    fn the_least_of_several_is_printed_two_by_two() {
        let text = Expr::parse("min(a, b, 1)").expect("parses").to_wgsl(&mut |n| Some(n.to_owned())).expect("known names");
        assert_eq!(text, "min(min(a, b), 1.0f)");
    }

    #[test]
    fn prints_wgsl() {
        let e = Expr::parse("if(a.r > 0.5, a.r^2, 1/x)").expect("parses");
        let text = e.to_wgsl(&mut |n| Some(n.replace("a.r", "a.x"))).expect("known names");
        assert_eq!(text, "select((1.0f / x), expr_pow(a.x, 2.0f), (select(0.0, 1.0, a.x > 0.5f)) != 0.0)");
    }
}
