//! How long walks are cut into short dispatches.

use pipe_graph::prelude::*;

/// Threads, and how long each walks before its state is put away.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dispatches {
    /// Threads: one walk each at a time.
    pub(super) lanes: u32,
    /// Steps that each takes in one dispatch.
    pub(super) steps: u32,
    /// Dispatches between two questions whether all walks have ended.
    every: u32,
}

impl Dispatches {
    /// Some milliseconds a dispatch, a few tens between two questions: for as many walks.
    pub(super) fn new(profile: Profile, walks: u32) -> Self {
        let (most, steps, every) = match profile {
            Profile::Gpu => (131_072, 32, 8),
            Profile::Cpu => (2048, 128, 4),
        };
        Self { lanes: walks.next_multiple_of(64).min(most), steps, every }
    }

    /// Until `left`, the number of walks that have not ended, is 0; or all threads have taken `most` steps for each of their
    /// `walks`.
    pub(super) fn until(&self, left: ResourceId, walks: u32, most: u64) -> Count {
        let max = u64::from(walks.div_ceil(self.lanes)) * (most / u64::from(self.steps) + 1);
        Count::Until { value: left, limit: 0.5, every: self.every, max: u32::try_from(max).unwrap_or(u32::MAX) }
    }
}
