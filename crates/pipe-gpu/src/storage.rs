//! Slots → textures and buffers, kept for reuse across plans and frames.

use pipe_plan::plan::{Launch, Plan, Slot, Storage};
use wgpu::{BufferUsages, TextureUsages};

use crate::device::Device;
use crate::error::GpuError;
use crate::formats;

/// One physical resource.
#[derive(Clone)]
pub(crate) enum Memory {
    Texture { texture: wgpu::Texture, view: wgpu::TextureView },
    Buffer(wgpu::Buffer),
}

/// Memory that no plan uses at present.
#[derive(Default)]
pub(crate) struct Pool {
    free: Vec<(Slot, bool, Memory)>,
}

impl Pool {
    /// Memory for every slot of a plan. What no slot took is freed first when it is not of use any more.
    pub(crate) fn take(&mut self, device: &Device, plan: &Plan) -> Result<Vec<Memory>, GpuError> {
        let target = |i: usize| is_target(plan, i);
        let mut taken: Vec<Option<Memory>> = Vec::with_capacity(plan.slots.len());
        for (i, slot) in plan.slots.iter().enumerate() {
            let found = self.free.iter().position(|(s, t, _)| s == slot && *t == target(i));
            taken.push(found.map(|at| self.free.swap_remove(at).2));
        }
        // Nothing new is allocated while memory that fits nothing is held.
        self.free.clear();
        let mut all = Vec::with_capacity(taken.len());
        for (i, memory) in taken.into_iter().enumerate() {
            all.push(match memory {
                Some(memory) => memory,
                None => allocate(device, &plan.slots[i], target(i), &plan.name)?,
            });
        }
        Ok(all)
    }

    /// Takes a plan's memory back.
    pub(crate) fn give(&mut self, plan: &Plan, memory: Vec<Memory>) {
        for (i, (slot, memory)) in plan.slots.iter().zip(memory).enumerate() {
            self.free.push((slot.clone(), is_target(plan, i), memory));
        }
    }
}

/// Whether points are drawn into a slot; such kernels name their target's format.
fn is_target(plan: &Plan, slot: usize) -> bool {
    let Storage::Image(image) = plan.slots[slot].storage else { return false };
    plan.kernels.iter().any(|k| k.launch == Launch::Points(image))
}

/// Memory outside any slot, of the same kind as a slot's.
pub(crate) fn allocate(device: &Device, slot: &Slot, target: bool, what: &str) -> Result<Memory, GpuError> {
    let gpu = &device.device;
    let scope = gpu.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let texture = |size: wgpu::Extent3d, dimension, format| {
        // COPY_DST keeps wgpu from clearing the texture with a render pass at its first use.
        let mut usage =
            TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC | TextureUsages::COPY_DST;
        if target {
            usage |= TextureUsages::RENDER_ATTACHMENT;
        }
        let texture = gpu.create_texture(&wgpu::TextureDescriptor {
            label: Some(what),
            size,
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
    let extent = |w, h, d| wgpu::Extent3d { width: w, height: h, depth_or_array_layers: d };
    let memory = match slot.storage {
        Storage::Image(t) => texture(extent(t.size[0], t.size[1], 1), wgpu::TextureDimension::D2, formats::of_image(t)),
        Storage::Volume(t) => texture(extent(t.size[0], t.size[1], t.size[2]), wgpu::TextureDimension::D3, formats::of_volume(t)),
        Storage::Buffer { bytes } => {
            let mut usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
            if device.mappable() {
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
