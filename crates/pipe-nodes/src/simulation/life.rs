//! `Life`: Conway's game, and every automaton of its family.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::state::widened;
use crate::shader;

/// A cellular automaton on the eight neighbours. A cell is alive above 0.5; the result is 0 or 1. Each colour channel is
/// a world of its own, alpha is kept. `options.border` is the rim: `Black` is dead, `Repeat` joins opposite edges.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Life {
    /// The first generation.
    image: In<Image>,
    /// Generations.
    #[default = 100]
    #[schemars(range(min = 0, max = 100_000_000))]
    steps: u32,
    /// How many living neighbours bring a dead cell to life (B) and keep a living one (S): `"B3/S23"` is Conway's.
    #[default = "B3/S23"]
    rule: String,
}

pub(crate) const KIND: Kind = Kind::of::<Life>(
    "Life",
    Category::Simulation,
    &[
        r#"Life(image: "grey", steps: 3)"#,
        r#"Life(image: "in", steps: 5, rule: "B36/S23")"#,
        r#"Life(image: "pair", steps: 1, rule: "b1357/s1357")"#,
        r#"Life(image: "grey", steps: 0)"#,
    ],
)
.tolerance(0.0, 0.0);

/// Bit n of a set: n living neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rule {
    birth: u32,
    survival: u32,
}

impl Rule {
    fn parse(text: &str) -> Option<Self> {
        let lower = text.trim().to_ascii_lowercase();
        let (birth, survival) = lower.split_once('/')?;
        let set = |digits: &str| digits.chars().try_fold(0_u32, |set, c| c.to_digit(9).map(|n| set | 1 << n));
        Some(Self { birth: set(birth.strip_prefix('b')?)?, survival: set(survival.strip_prefix('s')?)? })
    }
}

impl Life {
    fn parsed(&self) -> Result<Rule, Mistake> {
        Rule::parse(&self.rule).ok_or_else(|| {
            Mistake::in_field("rule", format!("`{}` is no rule", self.rule))
                .hint("expected B, the numbers of neighbours that give birth, /S, those that keep alive: \"B3/S23\"")
        })
    }
}

impl Node for Life {
    fn open(&mut self, _: &Opening<'_>) -> Result<(), Mistake> {
        self.parsed().map(drop)
    }

    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let image = inputs.image(&self.image);
        Ok(Output::out(EdgeType::image(image.size, image.channels)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let rule = self.parsed()?;
        let image = cx.input(&self.image);
        let image = widened(cx, image);
        if self.steps == 0 {
            cx.emit("out", image);
            return Ok(());
        }
        let shape = cx.shape(image);
        let end = cx.repeat("", Count::Fixed(self.steps), &[image], |cx, states| {
            let next = cx.intermediate("next", shape);
            cx.pass("step", shader!("simulation/life"))
                .read("image", states[0], Reach::Around(1, 1))
                .write("out", next)
                .param("birth", rule.birth)
                .param("survival", rule.survival)
                .add();
            Ok(vec![next])
        })?;
        cx.emit("out", end[0]);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let rule = self.parsed().expect("`open` has checked the rule");
        let mut world = cx.image(&self.image).clone();
        for _ in 0..self.steps {
            world = Raster::from_fn(world.size, world.channels, |x, y| {
                let here = world.at(x, y);
                let mut next = here;
                for c in 0..3 {
                    let mut living = 0;
                    for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
                        living += u32::from(world.load(x + dx, y + dy, cx.border)[c] > 0.5);
                    }
                    let set = if here[c] > 0.5 { rule.survival } else { rule.birth };
                    next[c] = f64::from(set >> living & 1);
                }
                next
            });
        }
        vec![Tensor::Image(world)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules() {
        assert_eq!(Rule::parse("B3/S23"), Some(Rule { birth: 0b1000, survival: 0b1100 }));
        assert_eq!(Rule::parse(" b0/s8 "), Some(Rule { birth: 1, survival: 256 }));
        assert_eq!(Rule::parse("B/S"), Some(Rule { birth: 0, survival: 0 }));
        for wrong in ["B3S23", "23/3", "B9/S", "B3/S2x", ""] {
            assert_eq!(Rule::parse(wrong), None, "{wrong}");
        }
    }
}
