//! GPU time of launches, by name.
//!
//! Timestamps are portable at the ends of passes only, so while profiling every launch is a pass of its own. Where a
//! device has none, the caller submits launches one by one and gives wall time instead.

use indexmap::IndexMap;

use crate::device::Device;
use crate::error::GpuError;
use crate::patience::Patience;

/// Timestamps that one query set holds: two a launch.
const QUERIES: u32 = 512;

/// Measures launches.
pub(crate) struct Stopwatch {
    queries: Option<Queries>,
    times: IndexMap<String, f64>,
}

struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    names: Vec<String>,
}

impl Stopwatch {
    pub(crate) fn new(device: &Device) -> Self {
        let queries = device.has_timestamps().then(|| {
            let buffer = |usage| {
                device.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("timestamps"),
                    size: u64::from(QUERIES) * 8,
                    usage,
                    mapped_at_creation: false,
                })
            };
            Queries {
                set: device.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("timestamps"),
                    ty: wgpu::QueryType::Timestamp,
                    count: QUERIES,
                }),
                resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
                readable: buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
                names: Vec::new(),
            }
        });
        Self { queries, times: IndexMap::new() }
    }

    /// Whether wall time must be given instead of timestamps.
    pub(crate) fn by_hand(&self) -> bool {
        self.queries.is_none()
    }

    /// Whether what was started must be submitted and read before more is started.
    pub(crate) fn full(&self) -> bool {
        self.queries.as_ref().is_some_and(|q| 2 * q.names.len() as u32 >= QUERIES)
    }

    /// Where the next pass writes its two timestamps.
    pub(crate) fn start(&mut self, name: &str) -> Option<(wgpu::QuerySet, u32)> {
        let q = self.queries.as_mut()?;
        q.names.push(name.to_owned());
        Some((q.set.clone(), 2 * (q.names.len() as u32 - 1)))
    }

    /// Adds wall time, in milliseconds.
    pub(crate) fn add(&mut self, name: &str, ms: f64) {
        *self.times.entry(name.to_owned()).or_default() += ms;
    }

    /// Makes what was started readable after this encoder's work.
    pub(crate) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(q) = self.queries.as_ref().filter(|q| !q.names.is_empty()) {
            let n = 2 * q.names.len() as u32;
            encoder.resolve_query_set(&q.set, 0..n, &q.resolved, 0);
            encoder.copy_buffer_to_buffer(&q.resolved, 0, &q.readable, 0, u64::from(n) * 8);
        }
    }

    /// Reads what was resolved by a submission that is done.
    pub(crate) fn read(&mut self, device: &Device, patience: &Patience<'_>) -> Result<(), GpuError> {
        let Some(q) = self.queries.as_mut().filter(|q| !q.names.is_empty()) else { return Ok(()) };
        let bytes = q.names.len() as u64 * 16;
        patience.map(device, &q.readable, wgpu::MapMode::Read, bytes, None, "timestamps")?;
        let period = f64::from(device.queue.get_timestamp_period());
        let view = q.readable.get_mapped_range(0..bytes);
        let view = view.map_err(|e| GpuError::Refused { node: "timestamps".into(), message: e.to_string() })?;
        let word = |i: usize| view[i * 8..i * 8 + 8].iter().rev().fold(0_u64, |w, byte| w << 8 | u64::from(*byte));
        for (i, name) in q.names.drain(..).enumerate() {
            // A clock that was reset in between counts as nothing.
            let ms = word(2 * i + 1).saturating_sub(word(2 * i)) as f64 * period / 1e6;
            *self.times.entry(name).or_default() += ms;
        }
        drop(view);
        q.readable.unmap();
        Ok(())
    }

    /// GPU milliseconds by name, in the order of first launch.
    pub(crate) fn into_times(self) -> IndexMap<String, f64> {
        self.times
    }
}
