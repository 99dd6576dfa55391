//! Waiting for the device: never longer than the caller allows, and only while nobody cancels.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::device::Device;
use crate::error::GpuError;

/// How often a wait looks at whether it was cancelled.
const LOOK: Duration = Duration::from_millis(50);

/// How long to wait.
#[derive(Clone, Copy, Default)]
pub(crate) struct Patience<'a> {
    limit: Option<Duration>,
    deadline: Option<Instant>,
    cancel: Option<&'a AtomicBool>,
}

impl<'a> Patience<'a> {
    /// Starts the clock.
    pub(crate) fn new(limit: Option<Duration>, cancel: Option<&'a AtomicBool>) -> Self {
        // A limit too far away to be an instant is none.
        Self { limit, deadline: limit.and_then(|l| Instant::now().checked_add(l)), cancel }
    }

    /// Whether it is over; `node` is what was running.
    pub(crate) fn check(&self, node: &str) -> Result<(), GpuError> {
        if self.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
            return Err(GpuError::Interrupted);
        }
        match (self.deadline, self.limit) {
            (Some(deadline), Some(limit)) if Instant::now() >= deadline => Err(GpuError::Timeout { node: node.to_owned(), limit }),
            _ => Ok(()),
        }
    }

    /// Waits for a submission, or for everything.
    pub(crate) fn wait(&self, device: &Device, submission: Option<&wgpu::SubmissionIndex>, node: &str) -> Result<(), GpuError> {
        loop {
            let left = self.deadline.map_or(LOOK, |d| d.saturating_duration_since(Instant::now()).min(LOOK));
            let poll = wgpu::PollType::Wait { submission_index: submission.cloned(), timeout: Some(left) };
            match device.device.poll(poll) {
                Ok(_) => return device.check(node),
                Err(wgpu::PollError::Timeout) => {
                    device.check(node)?;
                    self.check(node)?;
                }
                Err(e) => {
                    device.check(node)?;
                    return Err(GpuError::Refused { node: node.to_owned(), message: e.to_string() });
                }
            }
        }
    }

    /// Maps the start of a buffer, which `last` used last.
    pub(crate) fn map(
        &self,
        device: &Device,
        buffer: &wgpu::Buffer,
        mode: wgpu::MapMode,
        bytes: u64,
        last: Option<&wgpu::SubmissionIndex>,
        node: &str,
    ) -> Result<(), GpuError> {
        let (send, receive) = std::sync::mpsc::channel();
        buffer.map_async(mode, 0..bytes, move |result| drop(send.send(result)));
        // Waiting for less than everything lets later work go on; a driver that is not done mapping then gets more.
        let early = match last {
            Some(_) => self.wait(device, last, node),
            None => device.device.poll(wgpu::PollType::Poll).map_or(Ok(()), |_| device.check(node)),
        };
        let answer = early.and_then(|()| match receive.try_recv() {
            Ok(answer) => Ok(Some(answer)),
            Err(_) => self.wait(device, None, node).map(|()| receive.try_recv().ok()),
        });
        match answer {
            Ok(Some(Ok(()))) => Ok(()),
            Ok(Some(Err(e))) => {
                device.check(node)?;
                Err(GpuError::Refused { node: node.to_owned(), message: e.to_string() })
            }
            Ok(None) => {
                buffer.unmap();
                Err(GpuError::Lost { node: node.to_owned(), reason: "the driver never answered".into() })
            }
            Err(e) => {
                // Takes the request back, so that the buffer can be used again.
                buffer.unmap();
                Err(e)
            }
        }
    }
}
