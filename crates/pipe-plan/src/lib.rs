//! The planner of `pipe`: lower, prune, fuse, schedule, allocate, compose. Pure functions between plain types.

pub mod plan;
