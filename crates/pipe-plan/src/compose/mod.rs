//! Passes → WGSL. What shaders may say is fixed in `shaders/README.md`; this module makes it true.
//!
//! A kernel is a set of WESL modules, put together by the `wesl` crate into one WGSL text:
//!
//! - `package::lib::…`: the shared functions of `shaders/lib`,
//! - `package::io`: bindings, the uniform block, and raw access to every bound resource,
//! - `package::s0`, `package::s1` …: each stage's shader behind a generated prelude of ports, parameters and
//!   constants, so the same shader can stand many times in one kernel without renaming by hand,
//! - `package::main`: the entry point, which covers the grid and calls the last stage.
//!
//! A `Kernel` shader has its own entry point; its stage is the main module itself. Folds share one, see `walk`.
//!
//! Texts are put together where a kernel is compiled, once for each distinct one.

mod entry;
mod layout;
mod ports;
mod walk;

use std::fmt::Write as _;

use indexmap::IndexSet;
use pipe_graph::pass::{Access, Entry, Grid, Limits, Profile, ResourceId, Shape};
use pipe_graph::wgsl::{LIBRARY, is_bounded};

use crate::PlanError;
use crate::kernel_pass::{KernelPass, Ops, Source, StagePort};
use crate::plan::{self, Binding, Kernel, KernelId, Launch};
use crate::window::Windows;

pub(crate) use entry::Cover;
pub(crate) use layout::{Place, Placed};

/// What a composed pass binds and launches.
pub(crate) struct Composed {
    pub(crate) kernel: KernelId,
    /// Bound resources in binding order, the uniform block left out.
    pub(crate) resources: Vec<ResourceId>,
    pub(crate) uniforms: Vec<u8>,
    /// What in the uniform block differs from tile to tile.
    pub(crate) places: Vec<Place>,
    pub(crate) cover: Cover,
}

/// Composes kernels and keeps one of each.
pub(crate) struct Composer<'a> {
    limits: &'a Limits,
    ops: &'a Ops,
    kernels: IndexSet<Kernel>,
}

/// A bound resource.
struct Bound {
    resource: ResourceId,
    shape: Shape,
    use_: Use,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Use {
    Read,
    Write(Access),
}

impl<'a> Composer<'a> {
    pub(crate) fn new(limits: &'a Limits, ops: &'a Ops) -> Self {
        Self { limits, ops, kernels: IndexSet::new() }
    }

    pub(crate) fn limits(&self) -> &'a Limits {
        self.limits
    }

    /// Writes the modules of a pass; of a tile's with the windows of what is held in part.
    pub(crate) fn compose(&mut self, pass: &KernelPass, windows: Option<&Windows>) -> Result<Composed, PlanError> {
        let bound = self.bound(pass);
        let drivers: Vec<ResourceId> = distinct(pass.drivers());
        let windowed = windows.map(|w| {
            let image_written = |b: &Bound| b.use_ != Use::Read && matches!(b.shape, Shape::Image(_));
            let held = bound.iter().enumerate().filter(|(_, b)| w.views.contains_key(&b.resource) || image_written(b));
            held.map(|(i, b)| (i, b.resource)).collect::<Vec<_>>()
        });
        let in_part = |id: ResourceId| windows.filter(|w| w.views.contains_key(&id));
        let block = layout::Block::new(pass, windowed.as_deref());
        let uniforms = block.bytes(pass);
        let has_uniform = !uniforms.is_empty();
        let kernel_entry = pass.last().entry == Entry::Kernel;

        let mut bindings = Vec::new();
        let mut io = String::new();
        if has_uniform {
            bindings.push(Binding::Uniform { bytes: uniforms.len() as u32 });
            io.push_str(&block.declaration());
        }
        let mut resources = Vec::new();
        for (i, b) in bound.iter().enumerate() {
            let at = bindings.len();
            bindings.push(ports::binding(b.shape, b.use_, self.limits));
            resources.push(b.resource);
            match (b.shape, windows) {
                (Shape::Image(t), Some(_)) if in_part(b.resource).is_some() => {
                    ports::declare_window(&mut io, i, at, t, b.use_, self.limits);
                }
                (Shape::Image(t), Some(_)) if b.use_ != Use::Read => ports::declare_tile(&mut io, i, at, t, self.limits),
                _ => ports::declare(&mut io, i, at, b.shape, b.use_, self.limits),
            }
        }
        for (i, id) in drivers.iter().enumerate() {
            let at = bindings.len();
            bindings.push(Binding::ReadBuffer);
            resources.push(*id);
            let _ = writeln!(io, "@group(0) @binding({at}) var<storage, read> d{i}: vec4f;");
        }
        if has_bounded_loops(pass) {
            let at = bindings.len();
            bindings.push(Binding::Overrun);
            let most = most_rounds(self.limits);
            let _ = writeln!(
                io,
                "@group(0) @binding({at}) var<storage, read_write> overrun: atomic<u32>;\nvar<private> rounds: u32;\n\
                 fn too_long() -> bool {{ rounds += 1u; if rounds <= {most}u {{ return false; }} atomicStore(&overrun, 1u); return true; }}"
            );
        }
        if pass.last().entry == Entry::Points {
            // Behind the bindings: the image that is drawn into.
            resources.push(pass.writes[0].resource);
        }
        io.push_str("var<private> current: vec2i;\n");
        walk::declare(&mut io, pass);

        // The target of points is not bound and never asked for.
        let index = |id: ResourceId, write: bool| {
            bound.iter().position(|b| b.resource == id && (b.use_ != Use::Read) == write).unwrap_or(usize::MAX)
        };
        let mut modules = vec![("io".to_owned(), io)];
        let main = pass.stages.len() - 1;
        for (s, stage) in pass.stages.iter().enumerate() {
            let mut text = String::new();
            // The user's text comes first, so that its lines keep their numbers.
            text.push_str(&stage.shader.source);
            text.push('\n');
            for (name, constant) in &stage.constants {
                text.push_str(&layout::constant(name, *constant));
            }
            for port in &stage.ports {
                let raw = match port.source {
                    Source::Read(r) => ports::Raw::Bound(index(pass.reads[r], false)),
                    Source::Stage(producer) => ports::Raw::Stage { producer, size: self.size_source(pass, producer, &index) },
                };
                if let Some((id, size)) = self.pixels(pass, port) {
                    ports::pixels_port(&mut text, &port.name, index(id, false), size, in_part(id).is_some());
                }
                ports::read_port(&mut text, port, raw);
            }
            for write in pass.writes.iter().filter(|w| w.stage == s && stage.entry != Entry::Points) {
                let i = index(write.resource, true);
                let shape = self.ops.shape(write.resource);
                if let Shape::Pixels { size, .. } = shape {
                    ports::pixels_port(&mut text, &write.port, i, size, in_part(write.resource).is_some());
                }
                ports::write_port(&mut text, &write.port, i, shape, write.access);
            }
            if is_bounded(&stage.shader.source) {
                text.push_str("fn pipe_too_long() -> bool { return package::io::too_long(); }\n");
            }
            block.params(&mut text, s, stage, &drivers);
            let size = pass.writes.iter().find(|w| w.stage == s).or(pass.writes.first()).map(|w| index(w.resource, true));
            ports::place(&mut text, size.expect("a pass writes something"), stage);
            walk::place(&mut text, pass, stage);
            if stage.entry == Entry::Point {
                ports::point_value(&mut text, s, pass, &index);
            }
            if let (Grid::Blocks(_), true) = (pass.grid, kernel_entry && s == main) {
                let first = if windows.is_some() { "package::io::uniforms.grid_first + " } else { "" };
                let _ = writeln!(text, "fn block(group: vec3u) -> vec2i {{ return {first}vec2i(group.xy); }}");
            }
            let name = if kernel_entry && s == main {
                layout::bind_in_main(&mut text, pass);
                "main".to_owned()
            } else {
                format!("s{s}")
            };
            modules.push((name, text));
        }
        let cover = Cover::new(pass, self.ops, self.limits, windows.is_some())?;
        if let Grid::Walk(walk) = pass.grid {
            let size = match pass.image_of_fold().source {
                Source::Read(r) => ports::Size::Bound(index(pass.reads[r], false)),
                Source::Stage(producer) => self.size_source(pass, producer, &index),
            };
            modules.push(("main".to_owned(), walk::main_module(pass, walk, &size.text(), windows.is_some(), &index)));
        } else if !kernel_entry {
            modules.push(("main".to_owned(), entry::main_module(pass, &cover, self.ops, &index)));
        }
        let trusted = pass.stages.iter().all(|s| s.shader.trusted);
        let labels: Vec<&str> = pass.stages.iter().map(|s| &*s.shader.path).collect();
        let launch = match (pass.last().entry, self.ops.shape(pass.writes[0].resource)) {
            (Entry::Points, Shape::Image(t)) => Launch::Points(t),
            _ => Launch::Compute,
        };
        self.within_limits(pass, &bindings)?;
        let kernel = Kernel { label: labels.join(" + "), source: plan::Source::Modules(modules.into()), bindings, launch, trusted };
        let id = KernelId(self.kernels.insert_full(kernel).0 as u32);
        Ok(Composed { kernel: id, resources, uniforms, places: block.into_places(), cover })
    }

    /// Width and height of the pixels of a file behind a port.
    fn pixels(&self, pass: &KernelPass, port: &StagePort) -> Option<(ResourceId, [u32; 2])> {
        let Source::Read(r) = port.source else { return None };
        match self.ops.shape(pass.reads[r]) {
            Shape::Pixels { size, .. } => Some((pass.reads[r], size)),
            _ => None,
        }
    }

    fn bound(&self, pass: &KernelPass) -> Vec<Bound> {
        let read = |id: &ResourceId| Bound { resource: *id, shape: self.ops.shape(*id), use_: Use::Read };
        let mut bound: Vec<Bound> = pass.reads.iter().map(read).collect();
        // The render target of points is an attachment, not a binding.
        let points = pass.last().entry == Entry::Points;
        bound.extend(pass.writes.iter().filter(|_| !points).map(|w| Bound {
            resource: w.resource,
            shape: self.ops.shape(w.resource),
            use_: Use::Write(w.access),
        }));
        bound
    }

    /// A bound read of the size of a stage's value: the first image that its chain of producers loads.
    fn size_source(&self, pass: &KernelPass, stage: usize, index: &dyn Fn(ResourceId, bool) -> usize) -> ports::Size {
        let mut at = stage;
        loop {
            let image = pass.stages[at].ports.iter().find(|p| matches!(p.shape, Shape::Image(_) | Shape::Volume(_)));
            match image.map(|p| p.source) {
                Some(Source::Read(r)) => return ports::Size::Bound(index(pass.reads[r], false)),
                Some(Source::Stage(next)) => at = next,
                None => return ports::Size::Fixed(pass.stages[stage].shape),
            }
        }
    }

    fn within_limits(&self, pass: &KernelPass, bindings: &[Binding]) -> Result<(), PlanError> {
        let count = |f: fn(&Binding) -> bool| bindings.iter().filter(|b| f(b)).count() as u32;
        let sampled = count(|b| matches!(b, Binding::SampledImage | Binding::SampledVolume));
        let stored = count(|b| matches!(b, Binding::StorageImage(_) | Binding::StorageVolume(_)));
        let buffers = count(|b| matches!(b, Binding::ReadBuffer | Binding::WriteBuffer | Binding::Overrun));
        let l = self.limits;
        for (what, has, most) in [
            ("images to read", sampled, l.max_sampled_images),
            ("images to write", stored, l.max_storage_images),
            ("tables and scalars", buffers, l.max_storage_buffers),
        ] {
            if has > most {
                return Err(PlanError::TooManyBindings { name: pass.name.clone(), what, has, most });
            }
        }
        Ok(())
    }

    /// Every distinct kernel.
    pub(crate) fn finish(self) -> Vec<Kernel> {
        self.kernels.into_iter().collect()
    }
}

/// Whether loops of a user stand in it, which are counted.
fn has_bounded_loops(pass: &KernelPass) -> bool {
    pass.stages.iter().any(|stage| is_bounded(&stage.shader.source))
}

/// Rounds that all loops of a user's shader may make together in a thread. Mesa's software renderer ends eight threads
/// without a word after 65,535 rounds that any of them makes; a GPU takes some tenths of a second for these.
fn most_rounds(limits: &Limits) -> u32 {
    match limits.profile {
        Profile::Cpu => 32_000,
        Profile::Gpu => 1 << 22,
    }
}

fn distinct(ids: impl Iterator<Item = ResourceId>) -> Vec<ResourceId> {
    let mut out: Vec<ResourceId> = Vec::new();
    for id in ids {
        if !out.contains(&id) {
            out.push(id);
        }
    }
    out
}

/// One WGSL text from the modules; the last is the main one.
pub(crate) fn put_together(modules: &[(String, String)]) -> Result<String, String> {
    let mut resolver = wesl::VirtualResolver::new();
    let path = |name: &str| -> Result<wesl::ModulePath, String> { format!("package::{name}").parse().map_err(|e| format!("{e:?}")) };
    for (name, text) in LIBRARY {
        resolver.add_module(path(&format!("lib::{name}"))?, (*text).into());
    }
    for (name, text) in modules {
        resolver.add_module(path(name)?, text.as_str().into());
    }
    let mut compiler = wesl::Wesl::new_barebones().set_custom_resolver(resolver);
    compiler.use_imports(true).use_stripping(true).use_sourcemap(true).set_mangler(wesl::ManglerKind::Escape);
    let mut syntax = compiler.compile(&path("main")?).map_err(|e| e.to_string())?.syntax;
    // They come in an order that differs from run to run, which no cache of a driver would know again.
    syntax.global_declarations.sort_by_cached_key(ToString::to_string);
    Ok(syntax.to_string())
}
