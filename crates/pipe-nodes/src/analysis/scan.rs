//! `Scan`: prefix sums; the CDF of a histogram.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use super::prefix;

/// The prefix sum of a table, in log₂ n passes: entry i becomes the sum of the entries 0..i. That of a histogram is
/// its cumulative distribution.
///
/// Sums of u32 are exact, and wrap beyond 2³² − 1. A NaN reaches all later entries.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Scan {
    /// The table to scan, of f32 or u32.
    table: In<Table>,
    /// What combines two entries: `Sum`.
    op: Op,
    /// Whether entry i itself takes part in its sum. If not, the first entry is 0.
    #[default = true]
    inclusive: bool,
    /// How many entries a pass combines: log_radix n passes.
    #[default = 2]
    #[schemars(range(min = 2, max = 256))]
    radix: u32,
}

/// What combines two entries.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
enum Op {
    /// a + b
    #[default]
    Sum,
}

pub(crate) const KIND: Kind = Kind::of::<Scan>(
    "Scan",
    Category::Analysis,
    &[
        r#"Scan(table: "table")"#,
        r#"Scan(table: "table", inclusive: false)"#,
        r#"Scan(table: "curve", radix: 3)"#,
        r#"Scan(table: "curve", inclusive: false, radix: 64)"#,
        r#"Scan(table: "table", op: Sum, radix: 256)"#,
    ],
);

impl Node for Scan {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::Table(inputs.table(&self.table))))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let table = cx.input(&self.table);
        let scanned = prefix::scan(cx, "step", table, self.inclusive, self.radix);
        cx.emit("out", scanned);
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let mut total = 0.0;
        let entries = cx.table(&self.table).iter().map(|v| {
            let before = total;
            total += v;
            if self.inclusive { total } else { before }
        });
        vec![Tensor::Table(entries.collect())]
    }
}
