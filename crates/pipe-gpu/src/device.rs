//! An open device, and what its driver says out of turn.
//!
//! wgpu reports most mistakes and every loss of the device through callbacks, long after the call that caused them.
//! They are gathered here and turned into one [`GpuError`] by the next [`Device::check`], which knows what was
//! running.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pipe_graph::pass::Limits;
use wgpu::Features;

use crate::adapter::{self, AdapterDescription, Choice, OpenOptions};
use crate::error::GpuError;

/// How long the end of a program waits for work that nobody wants any more.
const FAREWELL: Duration = Duration::from_millis(500);

/// An open device. It may be opened on one thread and used on another.
#[allow(clippy::struct_field_names, reason = "`device` is wgpu's own name for it")]
pub struct Device {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) info: wgpu::AdapterInfo,
    features: Features,
    limits: Limits,
    /// Largest buffer that can be made, in bytes; a shader may be able to bind less of it.
    pub(crate) max_buffer: u64,
    description: AdapterDescription,
    options: OpenOptions,
    trouble: Arc<Trouble>,
}

/// What the driver said out of turn.
#[derive(Debug, Default)]
struct Trouble {
    lost: Mutex<Option<String>>,
    errors: Mutex<Vec<wgpu::Error>>,
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Device({})", self.info.name)
    }
}

impl Device {
    /// Opens a device with all that its adapter offers.
    pub fn open(choice: &Choice) -> Result<Self, GpuError> {
        Self::open_with(choice, OpenOptions::default())
    }

    /// Opens a device. Its limits are the adapter's own, so that bindings may be as large as the driver allows.
    pub fn open_with(choice: &Choice, options: OpenOptions) -> Result<Self, GpuError> {
        let (index, adapter) = adapter::choose(choice, options)?;
        let features = adapter::wanted(&adapter, options);
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("pipe"),
            required_features: features,
            required_limits: adapter.limits(),
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::Performance,
            trace: wgpu::Trace::Off,
        });
        let info = adapter.get_info();
        let (device, queue) = pollster::block_on(request).map_err(|e| GpuError::Open { name: info.name.clone(), reason: e.to_string() })?;
        let trouble = Arc::new(Trouble::default());
        let (of_lost, of_errors) = (trouble.clone(), trouble.clone());
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                *of_lost.lost.lock().unwrap_or_else(PoisonError::into_inner) = Some(message);
            }
        });
        device.on_uncaptured_error(Arc::new(move |error| {
            of_errors.errors.lock().unwrap_or_else(PoisonError::into_inner).push(error);
        }));
        Ok(Self {
            features,
            limits: adapter::limits(&adapter),
            max_buffer: adapter.limits().max_buffer_size,
            description: adapter::describe(index, &adapter, options),
            device,
            queue,
            info,
            options,
            trouble,
        })
    }

    /// Opens the same adapter once more, in the same way.
    pub(crate) fn reopen(&self) -> Result<Self, GpuError> {
        Self::open_with(&Choice::Index(self.description.index), self.options)
    }

    /// What plans for this device may use.
    pub fn limits(&self) -> Limits {
        self.limits
    }

    /// The adapter's name.
    pub fn name(&self) -> &str {
        &self.info.name
    }

    /// The adapter as `pipe devices` lists it.
    pub fn description(&self) -> &AdapterDescription {
        &self.description
    }

    /// Whether GPU time can be measured.
    pub fn has_timestamps(&self) -> bool {
        self.has(Features::TIMESTAMP_QUERY)
    }

    /// Whether points can be added up in 32-bit images.
    pub fn has_float_blending(&self) -> bool {
        self.has(Features::FLOAT32_BLENDABLE)
    }

    /// Whether the device shares memory with the host at full speed.
    pub fn shares_memory(&self) -> bool {
        self.has(Features::MAPPABLE_PRIMARY_BUFFERS)
    }

    pub(crate) fn has(&self, features: Features) -> bool {
        self.features.contains(features)
    }

    /// Turns what the driver said out of turn into an error that names the pass.
    pub(crate) fn check(&self, node: &str) -> Result<(), GpuError> {
        if let Some(reason) = self.trouble.lost.lock().unwrap_or_else(PoisonError::into_inner).clone() {
            return Err(GpuError::Lost { node: node.to_owned(), reason });
        }
        // The first mistake is the cause; the rest follow from it.
        let first = self.trouble.errors.lock().unwrap_or_else(PoisonError::into_inner).drain(..).next();
        match first {
            None => Ok(()),
            Some(wgpu::Error::OutOfMemory { .. }) => Err(GpuError::OutOfMemory { what: node.to_owned(), bytes: 0 }),
            Some(error) => Err(GpuError::Refused { node: node.to_owned(), message: error.to_string() }),
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let idle = self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(FAREWELL) });
        if matches!(idle, Err(wgpu::PollError::Timeout)) {
            // wgpu's queue waits for the device without a bound when it is dropped, which after a timeout may be
            // for ever. The process is about to end; the driver cleans up behind it.
            std::mem::forget(self.queue.clone());
        }
    }
}
