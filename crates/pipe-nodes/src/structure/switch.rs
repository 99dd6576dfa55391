//! `Switch`: one of several edges, chosen by a number.

use pipe_graph::prelude::*;

/// Passes one of its inputs on. What only the others need is never computed.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Switch {
    /// Which input, from 0: a number or an expression such as `"=if(draft, 1, 0)"`.
    index: u32,
    /// The choices: edges of one type.
    inputs: Vec<In<Any>>,
}

pub(crate) const KIND: Kind = Kind::of::<Switch>(
    "Switch",
    Category::Structure,
    &[
        r#"Switch(index: 1, inputs: ["in", "other"])"#,
        r#"Switch(inputs: ["grey"])"#,
        r#"Switch(index: "=2*0", inputs: ["volume", "fog"])"#,
        r#"Switch(index: 0, inputs: ["table", "curve"])"#,
    ],
)
.tolerance(0.0, 0.0);

impl Switch {
    fn chosen(&self) -> Result<&In<Any>, Mistake> {
        let n = self.inputs.len();
        self.inputs.get(self.index as usize).ok_or_else(|| match n {
            0 => Mistake::in_field("inputs", "there is nothing to choose from").hint("list the edges: `inputs: [\"a\", \"b\"]`"),
            _ => Mistake::in_field("index", format!("index {} is outside the {n} inputs", self.index))
                .hint(format!("expected 0 to {}", n - 1)),
        })
    }
}

impl Node for Switch {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        let ty = inputs.ty(self.chosen()?.edge);
        for (i, other) in self.inputs.iter().enumerate() {
            let kind = inputs.ty(other.edge).kind();
            if kind != ty.kind() {
                return Err(Mistake::in_field(format!("inputs[{i}]"), format!("is a {kind}, but the chosen input is a {}", ty.kind()))
                    .hint("all inputs must be of one type"));
            }
        }
        Ok(Output::out(ty))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        match cx.carried(self.chosen()?) {
            Carried::One(id) => cx.emit("out", id),
            Carried::Mesh(parts) => cx.emit_mesh("out", parts),
        }
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let chosen = self.chosen().expect("`outputs` has checked the index");
        vec![cx.input(chosen).clone()]
    }
}
