//! A plan with everything that it needs on the device: pipelines, memory, bind groups, made once.

use std::sync::{Arc, Mutex};

use pipe_graph::pass::Profile;
use pipe_plan::plan::{Binding, Launch, Plan, Repeat, Run, SlotId, Step, Tiling, Times};

use crate::device::Device;
use crate::error::GpuError;
use crate::memo::{Act, Key};
use crate::pipelines::Pipeline;
use crate::storage::Memory;

/// A plan with everything that it needs on the device.
pub struct Prepared {
    pub(crate) plan: Arc<Plan>,
    pub(crate) memory: Vec<Memory>,
    pub(crate) uniforms: Option<wgpu::Buffer>,
    pub(crate) steps: Vec<Ready>,
    /// Names of launches by [`ReadyRun::id`].
    pub(crate) names: Vec<String>,
    /// What launches cost in earlier runs, so that a later frame is cut into submissions well from its start.
    pub(crate) costs: Mutex<Costs>,
    pub(crate) memo: Memo,
    pub(crate) overrun: Option<Overrun>,
    pipelines: usize,
}

/// Where users' shaders say that their loops did not come to an end.
pub(crate) struct Overrun {
    pub(crate) buffer: wgpu::Buffer,
    /// The passes that have it bound.
    pub(crate) passes: String,
}

/// What makes it possible to leave out parts of a run.
pub(crate) struct Memo {
    /// What the plan's steps do.
    pub(crate) steps: Vec<Act>,
    /// What each slot holds, as far as that is known.
    pub(crate) contents: Mutex<Vec<Option<Key>>>,
}

/// GPU nanoseconds that one launch takes, by [`ReadyRun::id`]: a guess at first, then measured.
#[derive(Debug, Clone, Default)]
pub(crate) struct Costs(pub(crate) Vec<f64>);

/// A step that can be recorded.
pub(crate) enum Ready {
    Run(ReadyRun),
    Repeat(ReadyRepeat),
    Tiles(ReadyTiles),
}

pub(crate) struct ReadyTiles {
    pub(crate) clears: Vec<Memory>,
    pub(crate) body: Vec<Ready>,
    /// [`ReadyRun::id`] of the body's first launch; the others follow.
    pub(crate) first_id: usize,
    /// Position of the [`Step::Tiles`] in the plan, which says what differs from tile to tile.
    pub(crate) step: usize,
}

pub(crate) struct ReadyRun {
    /// Position in [`Prepared::names`].
    pub(crate) id: usize,
    pub(crate) pipeline: Arc<Pipeline>,
    pub(crate) group: wgpu::BindGroup,
    pub(crate) groups: [u32; 3],
    pub(crate) clears: Vec<Memory>,
    pub(crate) target: Option<wgpu::TextureView>,
}

pub(crate) struct ReadyRepeat {
    pub(crate) name: String,
    pub(crate) first: Vec<Ready>,
    pub(crate) odd: Vec<Ready>,
    pub(crate) even: Vec<Ready>,
    pub(crate) count: Times,
    pub(crate) settle: Vec<(Memory, Memory)>,
    /// For a loop of unknown length, the buffers of the value that ends it.
    pub(crate) values: Option<[wgpu::Buffer; 2]>,
}

impl Prepared {
    /// The plan.
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// How many pipelines it uses.
    pub fn pipeline_count(&self) -> usize {
        self.pipelines
    }

    /// Binds a plan's memory. `pipelines[i]` is that of kernel i.
    pub(crate) fn new(
        device: &Device,
        plan: Arc<Plan>,
        memory: Vec<Memory>,
        memo: Memo,
        uniforms: Option<wgpu::Buffer>,
        pipelines: &[Arc<Pipeline>],
    ) -> Result<Self, GpuError> {
        let mut maker = Maker {
            device,
            plan: &plan,
            memory: &memory,
            uniforms: uniforms.as_ref(),
            pipelines,
            names: Vec::new(),
            costs: Vec::new(),
            overrun: None,
        };
        let mut steps = maker.all(&plan.steps)?;
        for (i, step) in steps.iter_mut().enumerate() {
            if let Ready::Tiles(tiles) = step {
                tiles.step = i;
            }
        }
        let Maker { names, costs, overrun, .. } = maker;
        let pipelines = pipelines.len();
        Ok(Self { plan, memory, uniforms, steps, names, costs: Mutex::new(Costs(costs)), memo, overrun, pipelines })
    }
}

/// Gives each kernel the name of the first pass that launches it.
pub(crate) fn kernel_names(plan: &Plan) -> Vec<String> {
    fn visit(steps: &[Step], names: &mut [Option<String>]) {
        for step in steps {
            match step {
                Step::Run(run) => {
                    if let Some(name) = names.get_mut(run.kernel.0 as usize) {
                        name.get_or_insert_with(|| run.name.clone());
                    }
                }
                Step::Repeat(r) => [&r.first, &r.odd, &r.even].into_iter().for_each(|s| visit(s, names)),
                Step::Tiles(t) => visit(&t.body, names),
            }
        }
    }
    let mut names = vec![None; plan.kernels.len()];
    visit(&plan.steps, &mut names);
    names.into_iter().map(|n| n.unwrap_or_else(|| plan.name.clone())).collect()
}

/// Makes steps ready.
struct Maker<'a> {
    device: &'a Device,
    plan: &'a Plan,
    memory: &'a [Memory],
    uniforms: Option<&'a wgpu::Buffer>,
    pipelines: &'a [Arc<Pipeline>],
    names: Vec<String>,
    costs: Vec<f64>,
    overrun: Option<Overrun>,
}

fn inconsistent(node: &str, reason: impl Into<String>) -> GpuError {
    GpuError::Plan { node: node.to_owned(), reason: reason.into() }
}

impl Maker<'_> {
    fn all(&mut self, steps: &[Step]) -> Result<Vec<Ready>, GpuError> {
        steps
            .iter()
            .map(|step| match step {
                Step::Run(run) => Ok(Ready::Run(self.run(run)?)),
                Step::Repeat(repeat) => Ok(Ready::Repeat(self.repeat(repeat)?)),
                Step::Tiles(tiling) => Ok(Ready::Tiles(self.tiles(tiling)?)),
            })
            .collect()
    }

    fn memory(&self, slot: SlotId, node: &str) -> Result<&Memory, GpuError> {
        self.memory.get(slot.0 as usize).ok_or_else(|| inconsistent(node, format!("there is no slot {}", slot.0)))
    }

    fn repeat(&mut self, r: &Repeat) -> Result<ReadyRepeat, GpuError> {
        let (first, odd, even) = (self.all(&r.first)?, self.all(&r.odd)?, self.all(&r.even)?);
        let settle = r.settle.iter().map(|(from, to)| Ok((self.memory(*from, &r.name)?.clone(), self.memory(*to, &r.name)?.clone())));
        let values = match r.count {
            Times::Fixed(_) => None,
            Times::Until { value: [even, odd], .. } => {
                let buffer = |slot| Ok(self.memory(slot, &r.name)?.buffer(&r.name)?.clone());
                Some([buffer(even)?, buffer(odd)?])
            }
        };
        let settle = settle.collect::<Result<_, GpuError>>()?;
        Ok(ReadyRepeat { name: r.name.clone(), first, odd, even, count: r.count.clone(), settle, values })
    }

    fn tiles(&mut self, t: &Tiling) -> Result<ReadyTiles, GpuError> {
        let clears = t.clears.iter().map(|slot| Ok(self.memory(*slot, &t.name)?.clone())).collect::<Result<_, GpuError>>()?;
        let first_id = self.names.len();
        Ok(ReadyTiles { clears, body: self.all(&t.body)?, first_id, step: 0 })
    }

    /// One more pass whose loops may not come to an end.
    fn watch(&mut self, pass: &str) {
        let device = &self.device.device;
        let overrun = self.overrun.get_or_insert_with(|| Overrun {
            buffer: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("overrun"),
                size: 4,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            passes: String::new(),
        });
        if !overrun.passes.split(" or ").any(|known| known == pass) {
            let or = if overrun.passes.is_empty() { "" } else { " or " };
            overrun.passes += &format!("{or}{pass}");
        }
    }

    fn run(&mut self, run: &Run) -> Result<ReadyRun, GpuError> {
        let at = run.kernel.0 as usize;
        let (Some(kernel), Some(pipeline)) = (self.plan.kernels.get(at), self.pipelines.get(at)) else {
            return Err(inconsistent(&run.name, format!("there is no kernel {at}")));
        };
        let most = self.device.limits().max_groups;
        if kernel.launch == Launch::Compute && run.groups.iter().any(|n| *n > most) {
            let [x, y, z] = run.groups;
            return Err(GpuError::TooLarge {
                what: run.name.clone(),
                size: format!("{x}x{y}x{z} workgroups"),
                limit: format!("{most} along each axis"),
            });
        }
        if kernel.bindings.contains(&Binding::Overrun) {
            self.watch(&run.name);
        }
        let mut slots = run.slots.iter();
        let mut entries = Vec::new();
        for (i, binding) in kernel.bindings.iter().enumerate() {
            let resource = if let (Binding::Overrun, Some(overrun)) = (binding, &self.overrun) {
                overrun.buffer.as_entire_binding()
            } else if let Binding::Uniform { bytes } = binding {
                wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer: self.uniforms.ok_or_else(|| inconsistent(&run.name, "it has a uniform block, the plan has none"))?,
                    offset: run.uniform_offset.into(),
                    size: std::num::NonZeroU64::new((*bytes).into()),
                })
            } else {
                let slot = slots.next().ok_or_else(|| inconsistent(&run.name, "it names fewer slots than its kernel binds"))?;
                match self.memory(*slot, &run.name)? {
                    Memory::Texture { view, .. } => wgpu::BindingResource::TextureView(view),
                    Memory::Buffer(buffer) => buffer.as_entire_binding(),
                }
            };
            entries.push(wgpu::BindGroupEntry { binding: i as u32, resource });
        }
        let (target, drawn) = match kernel.launch {
            Launch::Compute => (None, None),
            Launch::Points(_) => {
                // Behind the bindings: the image that points are drawn into.
                let slot = slots.next().ok_or_else(|| inconsistent(&run.name, "it names no image to draw into"))?;
                match self.memory(*slot, &run.name)? {
                    Memory::Texture { view, .. } => (Some(view.clone()), Some(*slot)),
                    Memory::Buffer(_) => return Err(inconsistent(&run.name, "points are drawn into images only")),
                }
            }
        };
        let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&run.name),
            layout: &pipeline.layout,
            entries: &entries,
        });
        self.device.check(&run.name)?;
        // A target is cleared as it is loaded.
        let clears = run.clears.iter().filter(|slot| Some(**slot) != drawn);
        let clears = clears.map(|slot| Ok(self.memory(*slot, &run.name)?.clone())).collect::<Result<Vec<_>, GpuError>>()?;
        if clears.iter().any(|m| matches!(m, Memory::Texture { .. })) && !self.device.has(wgpu::Features::CLEAR_TEXTURE) {
            return Err(GpuError::Unsupported { node: run.name.clone(), what: "clearing of textures" });
        }
        self.names.push(run.name.clone());
        self.costs.push(guess(self.device, run.bytes));
        Ok(ReadyRun { id: self.names.len() - 1, pipeline: pipeline.clone(), group, groups: run.groups, clears, target })
    }
}

/// What a launch may cost, in nanoseconds, before it was ever measured. Too much only makes the first submissions
/// small; too little lets a watchdog bark.
fn guess(device: &Device, bytes: u64) -> f64 {
    match device.limits().profile {
        Profile::Gpu => (bytes as f64 / 50.0).clamp(2e6, 8e6),
        Profile::Cpu => (bytes as f64).clamp(8e6, 60e6),
    }
}
