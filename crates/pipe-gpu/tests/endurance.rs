//! Memory over very long loops. A process of its own: what is measured is the whole process.

#![allow(clippy::unwrap_used, clippy::single_range_in_vec_init, reason = "a test that panics has failed")]

mod common;

use common::{count_to, executor};

/// Bytes of this process in memory.
#[cfg(target_os = "linux")]
fn resident() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").unwrap();
    pages.split(' ').nth(1).unwrap().parse::<u64>().unwrap() * 4096
}

#[test]
#[cfg(target_os = "linux")]
fn a_hundred_thousand_iterations_take_no_more_memory_than_ten_thousand() {
    let mut e = executor();
    assert_eq!(count_to(&mut e, 10_000), 10_000);
    let before = resident();
    assert_eq!(count_to(&mut e, 100_000), 100_000);
    let grown = resident().saturating_sub(before);
    assert!(grown < 64 << 20, "{grown} bytes more");
}
