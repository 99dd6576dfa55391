//! Adapters: what there is, and which one is taken.
//!
//! Vulkan, Metal and DirectX 12; OpenGL only when the caller asks, because its drivers differ too much in what
//! compute shaders may do. A software renderer is a full citizen, taken when there is nothing better.

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
    /// Reads `--device`: a number, `cpu`, or part of a name. Nothing, or `best`, is [`Choice::Best`].
    pub fn parse(text: &str) -> Self {
        match text.trim() {
            "" | "best" => Self::Best,
            t if t.eq_ignore_ascii_case("cpu") => Self::Cpu,
            t => t.parse().map_or_else(|_| Self::Name(t.to_owned()), Self::Index),
        }
    }
}

/// How devices are looked for and opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OpenOptions {
    /// Look for OpenGL adapters too. They are found only by builds of wgpu with its feature `gles`.
    pub opengl: bool,
    /// On software adapters, map the buffers that kernels use instead of copying through staging buffers. Turned off
    /// to exercise on such a machine what a GPU does.
    pub share_memory: bool,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self { opengl: false, share_memory: true }
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

/// All adapters, the preferred one first.
pub fn enumerate() -> Vec<AdapterDescription> {
    enumerate_with(OpenOptions::default())
}

/// All adapters that these options let us see, the preferred one first.
pub fn enumerate_with(options: OpenOptions) -> Vec<AdapterDescription> {
    adapters(options).iter().enumerate().map(|(index, a)| describe(index, a, options)).collect()
}

pub(crate) fn describe(index: usize, adapter: &wgpu::Adapter, options: OpenOptions) -> AdapterDescription {
    let info = adapter.get_info();
    AdapterDescription {
        index,
        name: info.name.clone(),
        kind: rank(info.device_type).1,
        backend: format!("{:?}", info.backend).to_lowercase(),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        limits: limits(adapter),
        features: wanted(adapter, options).iter_names().map(|(name, _)| name.to_lowercase()).collect(),
        formats: formats::support(adapter),
    }
}

/// The adapter of a choice with its place in the list.
pub(crate) fn choose(choice: &Choice, options: OpenOptions) -> Result<(usize, wgpu::Adapter), GpuError> {
    let all = adapters(options);
    if all.is_empty() {
        return Err(GpuError::NoAdapter);
    }
    let names: Vec<String> = all.iter().map(|a| a.get_info().name).collect();
    let fits = |(i, adapter): &(usize, wgpu::Adapter)| match choice {
        Choice::Best => true,
        Choice::Index(n) => i == n,
        Choice::Name(name) => names[*i].to_lowercase().contains(&name.to_lowercase()),
        Choice::Cpu => adapter.get_info().device_type == DeviceType::Cpu,
    };
    all.into_iter().enumerate().find(fits).ok_or_else(|| {
        let wanted = match choice {
            Choice::Best => "best".to_owned(),
            Choice::Index(n) => n.to_string(),
            Choice::Name(name) => name.clone(),
            Choice::Cpu => "cpu".to_owned(),
        };
        let available: Vec<String> = names.iter().enumerate().map(|(i, n)| format!("{i}: {n}")).collect();
        GpuError::NoSuchDevice { wanted, available: available.join(", ") }
    })
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

/// Keeps Mesa's Vulkan layers from writing "error: XDG_RUNTIME_DIR is invalid or not set" to the user's terminal where there
/// is no session, as in containers: they look there for a display, which nobody needs here. Does nothing once the process
/// has a second thread; so it is for the first lines of `main`.
pub fn hush_layers() {
    const NAME: &str = "XDG_RUNTIME_DIR";
    let alone = std::fs::read_dir("/proc/self/task").is_ok_and(|tasks| tasks.count() == 1);
    if alone && std::env::var_os(NAME).is_none() {
        // SAFETY: this is the only thread, so nobody reads the environment meanwhile.
        #[allow(unsafe_code)]
        unsafe {
            std::env::set_var(NAME, "/nonexistent");
        }
    }
}

fn adapters(options: OpenOptions) -> Vec<wgpu::Adapter> {
    let mut desc = wgpu::InstanceDescriptor::new_without_display_handle();
    desc.backends = Backends::VULKAN | Backends::METAL | Backends::DX12;
    if options.opengl {
        desc.backends |= Backends::GL;
    }
    desc.flags = wgpu::InstanceFlags::empty();
    let instance = wgpu::Instance::new(desc);
    let mut list = pollster::block_on(instance.enumerate_adapters(Backends::all()));
    // A stable sort: equal adapters stay in the driver's order.
    list.sort_by_key(|a| rank(a.get_info().device_type).0);
    list
}

/// Features that are used where they are present.
pub(crate) fn wanted(adapter: &wgpu::Adapter, options: OpenOptions) -> Features {
    let mut wanted = Features::TIMESTAMP_QUERY
        | Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES
        | Features::PIPELINE_CACHE
        | Features::CLEAR_TEXTURE
        | Features::SUBGROUP
        | Features::FLOAT32_BLENDABLE;
    // On a GPU, buffers that the host can map lie in slow memory; on a CPU all memory is the same.
    if options.share_memory && adapter.get_info().device_type == DeviceType::Cpu {
        wanted |= Features::MAPPABLE_PRIMARY_BUFFERS;
    }
    wanted & adapter.features()
}

pub(crate) fn limits(adapter: &wgpu::Adapter) -> Limits {
    let l = adapter.limits();
    let half = [wgpu::TextureFormat::R16Float, wgpu::TextureFormat::Rg16Float];
    let storable = |f| adapter.get_texture_format_features(f).allowed_usages.contains(wgpu::TextureUsages::STORAGE_BINDING);
    let cpu = adapter.get_info().device_type == DeviceType::Cpu;
    Limits {
        profile: if cpu { Profile::Cpu } else { Profile::Gpu },
        max_image: l.max_texture_dimension_2d,
        max_volume: l.max_texture_dimension_3d,
        max_binding_bytes: l.max_storage_buffer_binding_size.min(l.max_buffer_size) & !255,
        max_sampled_images: l.max_sampled_textures_per_shader_stage,
        max_storage_images: l.max_storage_textures_per_shader_stage,
        max_storage_buffers: l.max_storage_buffers_per_shader_stage,
        max_groups: l.max_compute_workgroups_per_dimension,
        half_storage: adapter.features().contains(Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES) && half.into_iter().all(storable),
        // What drivers of GPUs say here is less than they give.
        max_piece: if cpu { largest_piece(adapter).unwrap_or(u64::MAX) } else { u64::MAX },
        budget: if cpu { available_memory() } else { own_memory(adapter).map(|bytes| bytes / 8 * 7) },
        tiled: false,
    }
}

/// What a GPU's driver lets this process take of the GPU's memory now, or else how much of it there is. Only Vulkan drivers
/// are asked. Staging buffers and what drivers need themselves come on top of a plan, so not all of it is for plans.
#[cfg(not(target_vendor = "apple"))]
fn own_memory(adapter: &wgpu::Adapter) -> Option<u64> {
    use ash::vk;
    // SAFETY: the adapter is only asked; nothing of it is kept or destroyed.
    #[allow(unsafe_code)]
    let vulkan = unsafe { adapter.as_hal::<wgpu::hal::api::Vulkan>() }?;
    let mut now = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
    let mut memory = vk::PhysicalDeviceMemoryProperties2::default();
    let tells = vulkan.physical_device_capabilities().supports_extension(ash::ext::memory_budget::NAME);
    if tells {
        memory = memory.push_next(&mut now);
    }
    // SAFETY: the physical device belongs to this instance, which the guard keeps alive. wgpu takes no adapter below
    // Vulkan 1.1, in which this function is. The chained structure lives as long, and the driver knows its extension.
    #[allow(unsafe_code)]
    unsafe {
        vulkan.shared_instance().raw_instance().get_physical_device_memory_properties2(vulkan.raw_physical_device(), &mut memory);
    }
    let heaps = memory.memory_properties.memory_heaps_as_slice().to_vec();
    let own = heaps.iter().enumerate().filter(|(_, heap)| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
    own.map(|(i, heap)| if tells { now.heap_budget[i].min(heap.size) } else { heap.size }).max().filter(|bytes| *bytes > 0)
}

/// The largest allocation that a Vulkan driver takes.
#[cfg(not(target_vendor = "apple"))]
fn largest_piece(adapter: &wgpu::Adapter) -> Option<u64> {
    use ash::vk;
    // SAFETY: the adapter is only asked; nothing of it is kept or destroyed.
    #[allow(unsafe_code)]
    let vulkan = unsafe { adapter.as_hal::<wgpu::hal::api::Vulkan>() }?;
    let mut most = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut most);
    // SAFETY: as above; what is chained is part of Vulkan 1.1.
    #[allow(unsafe_code)]
    unsafe {
        vulkan.shared_instance().raw_instance().get_physical_device_properties2(vulkan.raw_physical_device(), &mut properties);
    }
    Some(most.max_memory_allocation_size).filter(|bytes| *bytes > 0)
}

#[cfg(target_vendor = "apple")]
fn largest_piece(_: &wgpu::Adapter) -> Option<u64> {
    None
}

#[cfg(target_vendor = "apple")]
fn own_memory(_: &wgpu::Adapter) -> Option<u64> {
    None
}

/// Three quarters of the memory that Linux could give away now: decoded files need some too.
fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes / 4 * 3 * 1024)
}
