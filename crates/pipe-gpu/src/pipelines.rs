//! Kernels → pipelines: compiled in parallel, kept for the life of the executor, cached on disk where the driver can.
//!
//! Layouts are explicit, made from what the plan says a kernel binds; so a shader that disagrees with its plan is
//! refused when it is compiled, not when it runs. Uniform blocks are bound at their own offset, since a bind group for
//! each launch is made once anyway; dynamic offsets would save nothing.
//!
//! Compilers recurse over expressions (naga 30 overflows 2 MiB at about 5,000 chained terms, drivers are no better), so
//! kernels are compiled on threads of their own with a deep stack.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pipe_graph::types::Precision;
use pipe_plan::plan::{Binding, Kernel, Launch};
use rayon::prelude::*;

use crate::device::Device;
use crate::error::GpuError;
use crate::formats;

/// Stack of a compiling thread. Only what is touched is ever taken.
const STACK: usize = 256 << 20;

/// Kernels kept; beyond it, those that the current plan does not use are dropped.
const MOST: usize = 2048;

/// A compiled kernel.
pub(crate) struct Pipeline {
    pub(crate) layout: wgpu::BindGroupLayout,
    pub(crate) launch: Compiled,
}

/// What is launched.
pub(crate) enum Compiled {
    Compute(wgpu::ComputePipeline),
    Points(wgpu::RenderPipeline),
}

/// All pipelines made so far.
#[derive(Default)]
pub(crate) struct Pipelines {
    threads: Option<rayon::ThreadPool>,
    made: HashMap<Kernel, Arc<Pipeline>>,
    disk: Option<Disk>,
}

/// The driver's own cache, in a file.
struct Disk {
    cache: wgpu::PipelineCache,
    file: PathBuf,
    known: Vec<u8>,
}

impl Pipelines {
    /// Uses a folder to remember what the driver compiled. No trouble with it is an error: it is only a cache.
    pub(crate) fn with_cache(device: &Device, folder: &Path) -> Self {
        if !device.has(wgpu::Features::PIPELINE_CACHE) {
            return Self::default();
        }
        let Some(key) = wgpu::util::pipeline_cache_key(&device.info) else { return Self::default() };
        let file = folder.join(format!("{key}-{}", env!("CARGO_PKG_VERSION")));
        let known = std::fs::read(&file).unwrap_or_default();
        let desc =
            wgpu::PipelineCacheDescriptor { label: Some("pipe"), data: (!known.is_empty()).then_some(known.as_slice()), fallback: true };
        // SAFETY: the data came from `PipelineCache::get_data` of the same adapter, driver and program version, which
        // the file's name says; it was written whole and renamed, so it is never half a file.
        #[allow(unsafe_code)]
        let cache = unsafe { device.device.create_pipeline_cache(&desc) };
        Self { disk: Some(Disk { cache, file, known }), ..Self::default() }
    }

    /// Compiles what is not there yet; `nodes[i]` names kernel i in messages.
    pub(crate) fn compile(&mut self, device: &Device, kernels: &[Kernel], nodes: &[String]) -> Result<Vec<Arc<Pipeline>>, GpuError> {
        let missing: Vec<usize> = (0..kernels.len()).filter(|i| !self.made.contains_key(&kernels[*i])).collect();
        if !missing.is_empty() {
            let cache = self.disk.as_ref().map(|d| &d.cache);
            let all = || missing.par_iter().map(|i| compile(device, &kernels[*i], &nodes[*i], cache)).collect();
            if self.threads.is_none() {
                self.threads = rayon::ThreadPoolBuilder::new().stack_size(STACK).thread_name(|i| format!("compile {i}")).build().ok();
            }
            let made: Vec<Result<Pipeline, GpuError>> = match &self.threads {
                Some(threads) => threads.install(all),
                None => all(),
            };
            // The first in the order of the plan, so that the same mistakes give the same message.
            let mut first = Ok(());
            for (i, pipeline) in missing.into_iter().zip(made) {
                match pipeline {
                    Ok(pipeline) => drop(self.made.insert(kernels[i].clone(), Arc::new(pipeline))),
                    Err(e) => first = first.and(Err(e)),
                }
            }
            first?;
            self.save();
        }
        let used = kernels.iter().map(|k| self.made[k].clone()).collect();
        if self.made.len() > MOST {
            self.made.retain(|k, _| kernels.contains(k));
        }
        Ok(used)
    }

    fn save(&mut self) {
        let Some(disk) = &mut self.disk else { return };
        let Some(data) = disk.cache.get_data() else { return };
        if data == disk.known {
            return;
        }
        let write = || -> std::io::Result<()> {
            if let Some(folder) = disk.file.parent() {
                std::fs::create_dir_all(folder)?;
            }
            let part = disk.file.with_extension(format!("{}.part", std::process::id()));
            std::fs::write(&part, &data)?;
            std::fs::rename(&part, &disk.file)
        };
        if write().is_ok() {
            disk.known = data;
        }
    }
}

fn layout_entry(binding: u32, kind: Binding, launch: Launch) -> wgpu::BindGroupLayoutEntry {
    use wgpu::{BindingType as T, BufferBindingType as B, StorageTextureAccess, TextureSampleType, TextureViewDimension as D};
    let buffer = |ty| T::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let sampled =
        |view_dimension| T::Texture { sample_type: TextureSampleType::Float { filterable: false }, view_dimension, multisampled: false };
    let ty = match kind {
        Binding::Uniform { .. } => buffer(B::Uniform),
        Binding::SampledImage => sampled(D::D2),
        Binding::SampledVolume => sampled(D::D3),
        Binding::StorageImage(t) => {
            T::StorageTexture { access: StorageTextureAccess::WriteOnly, format: formats::of_image(t), view_dimension: D::D2 }
        }
        Binding::StorageVolume(t) => {
            T::StorageTexture { access: StorageTextureAccess::WriteOnly, format: formats::of_volume(t), view_dimension: D::D3 }
        }
        Binding::ReadBuffer => buffer(B::Storage { read_only: true }),
        Binding::WriteBuffer | Binding::Overrun => buffer(B::Storage { read_only: false }),
    };
    let visibility = match launch {
        Launch::Compute => wgpu::ShaderStages::COMPUTE,
        Launch::Points(_) => wgpu::ShaderStages::VERTEX_FRAGMENT,
    };
    wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
}

fn compile(device: &Device, kernel: &Kernel, node: &str, cache: Option<&wgpu::PipelineCache>) -> Result<Pipeline, GpuError> {
    let gpu = &device.device;
    let wgsl = kernel.wgsl().map_err(|e| GpuError::Plan { node: node.to_owned(), reason: e.to_string() })?;
    if let Launch::Points(target) = kernel.launch
        && target.precision == Precision::F32
        && !device.has_float_blending()
    {
        return Err(GpuError::Unsupported { node: node.to_owned(), what: "blending into 32-bit float images" });
    }
    let scopes =
        [wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::Validation].map(|f| gpu.push_error_scope(f));
    let desc = wgpu::ShaderModuleDescriptor { label: Some(&kernel.label), source: wgpu::ShaderSource::Wgsl(wgsl) };
    let module = if kernel.trusted {
        // SAFETY: only built-in shaders are trusted. They index their own bindings through the generated port
        // functions, which check what could leave a table or an image, and their loops end.
        #[allow(unsafe_code)]
        unsafe {
            gpu.create_shader_module_trusted(desc, wgpu::ShaderRuntimeChecks::unchecked())
        }
    } else {
        gpu.create_shader_module(desc)
    };
    let entries: Vec<_> = kernel.bindings.iter().enumerate().map(|(i, b)| layout_entry(i as u32, *b, kernel.launch)).collect();
    let layout = gpu.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(&kernel.label), entries: &entries });
    let pipeline_layout = gpu.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(&kernel.label),
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let compilation_options = wgpu::PipelineCompilationOptions { zero_initialize_workgroup_memory: !kernel.trusted, ..Default::default() };
    let launch = match kernel.launch {
        Launch::Compute => Compiled::Compute(gpu.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(&kernel.label),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options,
            cache,
        })),
        Launch::Points(target) => {
            let add = wgpu::BlendComponent {
                src_factor: wgpu::BlendFactor::One,
                dst_factor: wgpu::BlendFactor::One,
                operation: wgpu::BlendOperation::Add,
            };
            Compiled::Points(gpu.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(&kernel.label),
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("vertex_main"),
                    compilation_options: compilation_options.clone(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::PointList, ..Default::default() },
                depth_stencil: None,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fragment_main"),
                    compilation_options,
                    targets: &[Some(wgpu::ColorTargetState {
                        format: formats::of_image(target),
                        blend: Some(wgpu::BlendState { color: add, alpha: add }),
                        write_mask: wgpu::ColorWrites::ALL,
                    })],
                }),
                multiview_mask: None,
                cache,
            }))
        }
    };
    // Scopes end in the opposite order. What validation says comes first: it is about the shader.
    let errors: Vec<wgpu::Error> = scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop())).collect();
    match errors.into_iter().next() {
        None => Ok(Pipeline { layout, launch }),
        Some(wgpu::Error::OutOfMemory { .. }) => Err(GpuError::OutOfMemory { what: node.to_owned(), bytes: 0 }),
        Some(error) => Err(GpuError::Shader { node: node.to_owned(), label: kernel.label.clone(), message: error.to_string() }),
    }
}
