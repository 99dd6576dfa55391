//! Prefix sums of tables in log_r n steps (Hillis and Steele, Data Parallel Algorithms, 1986).
//!
//! After step k an entry holds the sum of the rᵏ⁺¹ entries up to its own. Every step reads r entries and writes
//! one; radix 2 is the textbook's, a larger one needs fewer passes. Tables are small (65,536 entries at most make
//! 16 or 4 passes), so a scan that does less work in more kinds of passes would not be faster.

use pipe_graph::prelude::*;

use super::reduction::extended;
use crate::shader;

/// The radix that internal scans use: two passes for 256 entries, four for 65,536.
pub(crate) const FAST_RADIX: u32 = 16;

/// The sum of every entry and all entries before it; without itself unless `inclusive`.
pub(crate) fn scan(cx: &mut Lowering<'_>, suffix: &str, table: ResourceId, inclusive: bool, radix: u32) -> ResourceId {
    let Shape::Table { len, element } = cx.shape(table) else { unreachable!("only tables are scanned") };
    let shader = match element {
        Element::U32 => extended(&shader!("analysis/scan_step"), "alias Entry = u32;"),
        Element::F32 => extended(&shader!("analysis/scan_step"), "alias Entry = f32;"),
    };
    let mut current = table;
    let mut stride = 1;
    // An exclusive scan is an inclusive one of the entries moved one place up, so its first step reads there.
    let mut shift = u32::from(!inclusive);
    while stride < len || shift > 0 {
        let next = cx.intermediate(&format!("{suffix}{stride}"), Shape::Table { len, element });
        cx.pass(&format!("{suffix}{stride}"), shader.clone())
            .entry(Entry::At)
            .read("table", current, Reach::Whole)
            .write("out", next)
            .constant("STRIDE", stride as i32)
            .constant("RADIX", radix.min(len.div_ceil(stride)).max(1) as i32)
            .constant("SHIFT", shift as i32)
            .add();
        current = next;
        shift = 0;
        stride = stride.saturating_mul(radix);
    }
    current
}
