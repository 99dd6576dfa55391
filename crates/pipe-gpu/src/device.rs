//! Adapters and devices.
//!
//! Vulkan, Metal and DirectX 12 only: OpenGL drivers differ too much in what compute shaders may do. A software
//! renderer is a full citizen, taken when there is nothing better.

use std::sync::{Arc, Mutex, PoisonError};

use pipe_graph::pass::{Limits, Profile};
use wgpu::{Backends, DeviceType, Features};

use crate::error::GpuError;
use crate::formats::{self, FormatSupport};

/// Which device to take.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Choice {
    /// Discrete, then integrated, then virtual, then software.
    #[default]
    Best,
    /// The n-th of `pipe devices`.
    Index(usize),
    /// The first whose name contains this, in any case.
    Name(String),
    /// A software renderer.
    Cpu,
}

impl Choice {
    /// Reads `--device`: a number, `cpu`, or part of a name.
    pub fn parse(text: &str) -> Self {
        match text.trim() {
            "" => Self::Best,
            "cpu" => Self::Cpu,
            t => t.parse().map_or_else(|_| Self::Name(t.to_owned()), Self::Index),
        }
    }
}

/// What is known of an adapter before it is opened.
#[derive(Debug, Clone, serde::Serialize)]
pub struct AdapterDescription {
    /// Position for `--device N`.
    pub index: usize,
    /// Its name.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `software`, `other`.
    pub kind: &'static str,
    /// The interface: vulkan, metal, dx12.
    pub backend: String,
    /// Driver and version.
    pub driver: String,
    /// What a plan would be made for.
    pub limits: Limits,
    /// Features that pipe uses and the adapter has.
    pub features: Vec<String>,
    /// What texture formats allow.
    pub formats: Vec<FormatSupport>,
}

const fn rank(kind: DeviceType) -> (u8, &'static str) {
    match kind {
        DeviceType::DiscreteGpu => (0, "discrete"),
        DeviceType::IntegratedGpu => (1, "integrated"),
        DeviceType::VirtualGpu => (2, "virtual"),
        DeviceType::Other => (3, "other"),
        DeviceType::Cpu => (4, "software"),
    }
}

fn adapters() -> Vec<wgpu::Adapter> {
    let mut desc = wgpu::InstanceDescriptor::new_without_display_handle();
    desc.backends = Backends::VULKAN | Backends::METAL | Backends::DX12;
    desc.flags = wgpu::InstanceFlags::empty();
    let instance = wgpu::Instance::new(desc);
    let mut list = pollster::block_on(instance.enumerate_adapters(Backends::all()));
    // A stable sort: equal adapters stay in the driver's order.
    list.sort_by_key(|a| rank(a.get_info().device_type).0);
    list
}

/// Features that are used where they are present.
fn wanted(adapter: &wgpu::Adapter) -> Features {
    let mut wanted = Features::TIMESTAMP_QUERY
        | Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES
        | Features::PIPELINE_CACHE
        | Features::SUBGROUP
        | Features::FLOAT32_BLENDABLE;
    // On a GPU, buffers that the host can map lie in slow memory; on a CPU all memory is the same.
    if adapter.get_info().device_type == DeviceType::Cpu {
        wanted |= Features::MAPPABLE_PRIMARY_BUFFERS;
    }
    wanted & adapter.features()
}

fn limits_of(adapter: &wgpu::Adapter) -> Limits {
    let l = adapter.limits();
    let half = [wgpu::TextureFormat::R16Float, wgpu::TextureFormat::Rg16Float];
    let storable = |f| adapter.get_texture_format_features(f).allowed_usages.contains(wgpu::TextureUsages::STORAGE_BINDING);
    Limits {
        profile: if adapter.get_info().device_type == DeviceType::Cpu { Profile::Cpu } else { Profile::Gpu },
        max_image: l.max_texture_dimension_2d,
        max_volume: l.max_texture_dimension_3d,
        max_binding_bytes: u64::from(l.max_storage_buffer_binding_size as u32).min(l.max_buffer_size) & !255,
        max_sampled_images: l.max_sampled_textures_per_shader_stage,
        max_storage_images: l.max_storage_textures_per_shader_stage,
        max_storage_buffers: l.max_storage_buffers_per_shader_stage,
        max_groups: l.max_compute_workgroups_per_dimension,
        half_storage: adapter.features().contains(Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES) && half.into_iter().all(storable),
        budget: None,
    }
}

/// All adapters, the preferred one first.
pub fn enumerate() -> Vec<AdapterDescription> {
    let describe = |(index, a): (usize, &wgpu::Adapter)| {
        let info = a.get_info();
        AdapterDescription {
            index,
            name: info.name.clone(),
            kind: rank(info.device_type).1,
            backend: format!("{:?}", info.backend).to_lowercase(),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            limits: limits_of(a),
            features: wanted(a).iter_names().map(|(name, _)| name.to_lowercase()).collect(),
            formats: formats::support(a),
        }
    };
    adapters().iter().enumerate().map(describe).collect()
}

/// An open device.
pub struct Device {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) info: wgpu::AdapterInfo,
    pub(crate) features: Features,
    limits: Limits,
    trouble: Arc<Trouble>,
    /// Keeps the driver's side of the adapter.
    _adapter: wgpu::Adapter,
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
        let all = adapters();
        if all.is_empty() {
            return Err(GpuError::NoAdapter);
        }
        let names: Vec<String> = all.iter().map(|a| a.get_info().name).collect();
        let fits = |i: &usize| match choice {
            Choice::Best => *i == 0,
            Choice::Index(n) => i == n,
            Choice::Name(name) => names[*i].to_lowercase().contains(&name.to_lowercase()),
            Choice::Cpu => all[*i].get_info().device_type == DeviceType::Cpu,
        };
        let Some(index) = (0..all.len()).find(fits) else {
            let wanted = match choice {
                Choice::Best => "best".to_owned(),
                Choice::Index(n) => n.to_string(),
                Choice::Name(name) => name.clone(),
                Choice::Cpu => "cpu".to_owned(),
            };
            return Err(GpuError::NoSuchDevice { wanted, available: names.join(", ") });
        };
        let adapter = all.into_iter().nth(index).expect("found above");
        let features = wanted(&adapter);
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("pipe"),
            required_features: features,
            required_limits: adapter.limits(),
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::Performance,
            trace: wgpu::Trace::Off,
        });
        let info = adapter.get_info();
        let (device, queue) =
            pollster::block_on(request).map_err(|e| GpuError::Open { name: info.name.clone(), reason: e.to_string() })?;
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
        let limits = limits_of(&adapter);
        Ok(Self { device, queue, info, features, limits, trouble, _adapter: adapter })
    }

    /// What plans for this device may use.
    pub fn limits(&self) -> Limits {
        self.limits
    }

    /// The adapter's name.
    pub fn name(&self) -> &str {
        &self.info.name
    }

    /// Whether the device shares memory with the host at full speed.
    pub(crate) fn mappable(&self) -> bool {
        self.features.contains(Features::MAPPABLE_PRIMARY_BUFFERS)
    }

    /// Whether GPU time can be measured.
    pub fn has_timestamps(&self) -> bool {
        self.features.contains(Features::TIMESTAMP_QUERY)
    }

    /// Turns what the driver said out of turn into an error that names the pass.
    pub(crate) fn check(&self, node: &str) -> Result<(), GpuError> {
        if let Some(reason) = self.trouble.lost.lock().unwrap_or_else(PoisonError::into_inner).clone() {
            return Err(GpuError::Lost { node: node.to_owned(), reason });
        }
        let first = self.trouble.errors.lock().unwrap_or_else(PoisonError::into_inner).drain(..).next();
        match first {
            None => Ok(()),
            Some(wgpu::Error::OutOfMemory { .. }) => Err(GpuError::OutOfMemory { what: node.to_owned(), bytes: 0 }),
            Some(error) => Err(GpuError::Refused { node: node.to_owned(), message: error.to_string() }),
        }
    }
}
