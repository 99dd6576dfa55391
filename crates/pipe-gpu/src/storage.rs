//! Slots → textures and buffers, kept for reuse across plans and frames.
//!
//! A slot is reused for one that holds what it needs or that equals it, never for a smaller one: plans of one graph at one
//! size are what comes again and again (frames, `watch`), and equal slots make that exact. Everything is checked against the device and
//! the budget before the first byte is allocated, so a plan that cannot run fails before it slowed anything down.

use pipe_plan::plan::{Launch, Plan, Slot, SlotId, Storage};
use wgpu::{BufferUsages, TextureUsages};

use crate::device::Device;
use crate::error::{GpuError, size};
use crate::formats;
use crate::memo::Key;

/// One physical resource.
#[derive(Debug, Clone)]
pub(crate) enum Memory {
    Texture { texture: wgpu::Texture, view: wgpu::TextureView },
    Buffer(wgpu::Buffer),
}

impl Memory {
    /// Copies all of it to memory of the same storage.
    pub(crate) fn copy_to(&self, to: &Self, encoder: &mut wgpu::CommandEncoder) {
        match (self, to) {
            (Self::Texture { texture: from, .. }, Self::Texture { texture: to, .. }) => {
                encoder.copy_texture_to_texture(from.as_image_copy(), to.as_image_copy(), from.size());
            }
            (Self::Buffer(from), Self::Buffer(to)) => encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size().min(to.size())),
            _ => unreachable!("copies are between slots of equal storage"),
        }
    }

    /// Fills it with zeros. Textures need `CLEAR_TEXTURE`, which [`check`] looks after.
    pub(crate) fn zero(&self, encoder: &mut wgpu::CommandEncoder) {
        match self {
            Self::Texture { texture, .. } => encoder.clear_texture(texture, &wgpu::ImageSubresourceRange::default()),
            Self::Buffer(buffer) => encoder.clear_buffer(buffer, 0, None),
        }
    }

    /// The buffer that it is.
    pub(crate) fn buffer(&self, plan: &str) -> Result<&wgpu::Buffer, GpuError> {
        match self {
            Self::Buffer(buffer) => Ok(buffer),
            Self::Texture { .. } => {
                Err(GpuError::Plan { node: plan.to_owned(), reason: "bytes cross between host and device in buffers only".into() })
            }
        }
    }
}

/// Memory that no plan uses at present.
#[derive(Default)]
pub(crate) struct Pool {
    free: Vec<Free>,
}

struct Free {
    slot: Slot,
    target: bool,
    memory: Memory,
    content: Option<Key>,
}

impl Free {
    /// Whether it can do all that a slot must; it may be able to do more.
    fn serves(&self, slot: &Slot) -> bool {
        self.slot.storage == slot.storage && self.slot.uploaded >= slot.uploaded && self.slot.fetched >= slot.fetched
    }
}

impl Pool {
    /// Memory for every slot of a plan, and what each holds: if possible one of the contents that are `useful` to that
    /// slot. What no slot took is freed before anything is allocated.
    pub(crate) fn take(&mut self, device: &Device, plan: &Plan, useful: &[Vec<Key>]) -> Result<(Vec<Memory>, Vec<Option<Key>>), GpuError> {
        let mut taken: Vec<Option<Free>> = plan.slots.iter().map(|_| None).collect();
        for by_content in [true, false] {
            for (i, slot) in plan.slots.iter().enumerate().filter(|(i, _)| taken[*i].is_none()).collect::<Vec<_>>() {
                let suits = |free: &Free| {
                    if by_content {
                        free.serves(slot) && free.content.is_some_and(|key| useful[i].contains(&key))
                    } else {
                        free.slot == *slot
                    }
                };
                let fits = |free: &Free| free.target == is_target(plan, i) && suits(free);
                taken[i] = self.free.iter().position(fits).map(|at| self.free.swap_remove(at));
            }
        }
        self.free.clear();
        let one = |(i, free): (usize, Option<Free>)| match free {
            Some(free) => Ok((free.memory, free.content)),
            None => Ok((allocate(device, &plan.slots[i], is_target(plan, i), &plan.name)?, None)),
        };
        taken.into_iter().enumerate().map(one).collect()
    }

    /// Takes a plan's memory back, with what it holds.
    pub(crate) fn give(&mut self, plan: &Plan, memory: Vec<Memory>, contents: Vec<Option<Key>>) {
        for (i, (memory, content)) in memory.into_iter().zip(contents).enumerate() {
            self.free.push(Free { slot: plan.slots[i].clone(), target: is_target(plan, i), memory, content });
        }
    }
}

/// Bytes that a plan's slots and kept frames take.
pub(crate) fn bytes_needed(plan: &Plan) -> u64 {
    let slots: u64 = plan.slots.iter().map(|s| s.storage.bytes()).sum();
    let kept = plan.histories.iter().filter_map(|h| Some(u64::from(h.delay) * slot(plan, h.keep)?.storage.bytes()));
    slots + kept.sum::<u64>()
}

/// Whether a device can hold a plan within a budget in bytes.
pub(crate) fn check(device: &Device, plan: &Plan, budget: Option<u64>) -> Result<(), GpuError> {
    let limits = device.limits();
    for (i, slot) in plan.slots.iter().enumerate() {
        let what = || format!("{}: slot {i}", plan.name);
        let (extent, most) = match slot.storage {
            Storage::Image(t) => (t.size.to_vec(), limits.max_image),
            Storage::Volume(t) => (t.size.to_vec(), limits.max_volume),
            Storage::Buffer { bytes } => {
                let most = limits.max_binding_bytes.min(device.max_buffer);
                if bytes > most {
                    return Err(GpuError::TooLarge { what: what(), size: format!("a buffer of {}", size(bytes)), limit: size(most) });
                }
                (Vec::new(), 0)
            }
        };
        if extent.iter().any(|n| *n > most) {
            let sides: Vec<String> = extent.iter().map(u32::to_string).collect();
            let kind = if extent.len() == 2 { "an image" } else { "a volume" };
            return Err(GpuError::TooLarge {
                what: what(),
                size: format!("{kind} of {}", sides.join("x")),
                limit: format!("{most} along each side"),
            });
        }
    }
    let needed = bytes_needed(plan);
    match budget.into_iter().chain(plan.limits.budget).min() {
        Some(budget) if needed > budget => Err(GpuError::OverBudget { what: plan.name.clone(), needed, budget, largest: largest(plan) }),
        _ => Ok(()),
    }
}

fn slot(plan: &Plan, id: SlotId) -> Option<&Slot> {
    plan.slots.get(id.0 as usize)
}

/// The three largest slots, in words.
fn largest(plan: &Plan) -> String {
    let mut order: Vec<usize> = (0..plan.slots.len()).collect();
    order.sort_by_key(|i| std::cmp::Reverse(plan.slots[*i].storage.bytes()));
    let one = |i: &usize| {
        let storage = plan.slots[*i].storage;
        let form = match storage {
            Storage::Image(t) => format!("image {}x{} of {} channels", t.size[0], t.size[1], t.channels),
            Storage::Volume(t) => format!("volume {}x{}x{} of {} channels", t.size[0], t.size[1], t.size[2], t.channels),
            Storage::Buffer { .. } => "buffer".to_owned(),
        };
        format!("slot {i} ({form}, {})", size(storage.bytes()))
    };
    order.iter().take(3).map(one).collect::<Vec<_>>().join(", ")
}

/// Whether points are drawn into a slot; such kernels name their target's format.
fn is_target(plan: &Plan, slot: usize) -> bool {
    let Storage::Image(image) = plan.slots[slot].storage else { return false };
    plan.kernels.iter().any(|k| k.launch == Launch::Points(image))
}

/// Memory of the kind that a slot has.
pub(crate) fn allocate(device: &Device, slot: &Slot, target: bool, what: &str) -> Result<Memory, GpuError> {
    let gpu = &device.device;
    let scope = gpu.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let texture = |size: [u32; 3], dimension, format| {
        // COPY_DST keeps wgpu from clearing the texture with a render pass at its first use.
        let mut usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC | TextureUsages::COPY_DST;
        if target {
            usage |= TextureUsages::RENDER_ATTACHMENT;
        }
        let texture = gpu.create_texture(&wgpu::TextureDescriptor {
            label: Some(what),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: size[2] },
            mip_level_count: 1,
            sample_count: 1,
            dimension,
            format,
            usage,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Memory::Texture { texture, view }
    };
    let memory = match slot.storage {
        Storage::Image(t) => texture([t.size[0], t.size[1], 1], wgpu::TextureDimension::D2, formats::of_image(t)),
        Storage::Volume(t) => texture(t.size, wgpu::TextureDimension::D3, formats::of_volume(t)),
        Storage::Buffer { bytes } => {
            let mut usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
            if device.shares_memory() {
                if slot.uploaded {
                    usage |= BufferUsages::MAP_WRITE;
                }
                if slot.fetched {
                    usage |= BufferUsages::MAP_READ;
                }
            }
            Memory::Buffer(gpu.create_buffer(&wgpu::BufferDescriptor { label: Some(what), size: bytes, usage, mapped_at_creation: false }))
        }
    };
    match pollster::block_on(scope.pop()) {
        Some(_) => Err(GpuError::OutOfMemory { what: what.to_owned(), bytes: slot.storage.bytes() }),
        None => Ok(memory),
    }
}
