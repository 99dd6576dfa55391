//! Entry points: how a grid is covered by workgroups.
//!
//! On a GPU images are covered by square groups (textures are block-linear: rows of 64 run at half speed), and a
//! thread takes several pixels when a pixel is small, since then threads and not bytes are the limit. On a CPU a
//! group is a long run of one row without barriers, and a thread takes several rows while there are enough groups.

use std::fmt::Write as _;

use pipe_graph::pass::{Entry, Grid, Limits, Profile, ResourceId, Shape};
use pipe_graph::types::Precision;

use super::ports::narrow;
use super::{layout, walk};
use crate::PlanError;
use crate::kernel_pass::{KernelPass, Ops, Source};

/// Entries from which on a thread takes several of a table.
const LONG_TABLE: u32 = 1 << 18;

/// How the grid is covered.
#[derive(Debug, Clone)]
pub(crate) struct Cover {
    /// Elements along x, y, z; `None` when it is the size of the first output, asked at run time.
    elements: [u32; 3],
    /// Threads of a workgroup.
    size: [u32; 3],
    /// Elements that one thread takes, and along which axis they lie (0 x, 1 y).
    each: u32,
    axis: usize,
    /// Workgroups.
    pub(crate) groups: [u32; 3],
    /// Groups of a row where there are too many for one row of a dispatch; the others follow in the next ones.
    row: Option<u32>,
    /// Type of the position: `vec2i`, `vec3i` or `i32`.
    position: &'static str,
    /// Whether it is the grid of a tile.
    tiled: bool,
}

impl Cover {
    /// How `pass` is covered. A pass of tiles covers as much as the largest tile asks for, from where its uniforms say.
    pub(super) fn new(pass: &KernelPass, ops: &Ops, limits: &Limits, tiled: bool) -> Result<Self, PlanError> {
        let stage = pass.last();
        let shape = ops.shape(pass.writes[0].resource);
        let position = position(stage.entry, &stage.shader.source, shape);
        let elements = match (pass.grid, shape) {
            (Grid::Groups(groups), _) => groups,
            (Grid::Walk(walk), _) => {
                let [x, y] = walk.groups(pass.image_of_fold().image_size());
                [x, y, 1]
            }
            (Grid::Elements(n), _) => n,
            (Grid::Blocks(block), _) => {
                let size = pass.plane(ops).unwrap_or([1, 1]);
                [size[0].div_ceil(block[0]), size[1].div_ceil(block[1]), 1]
            }
            (Grid::Pixels(per), _) => {
                let [w, h] = shape.plane().unwrap_or([1, 1]).map(u64::from);
                [u32::try_from((w * h).div_ceil(per.into())).unwrap_or(u32::MAX), 1, 1]
            }
            (Grid::Cover, Shape::Image(t)) => [t.size[0], t.size[1], 1],
            (Grid::Cover, Shape::Volume(t)) => t.size,
            (Grid::Cover, _) => [shape.entries(), 1, 1],
        };
        if matches!(stage.entry, Entry::Points | Entry::Kernel | Entry::Fold(_)) {
            let cover = Self { elements, size: [1; 3], each: 1, axis: 0, groups: elements, row: None, position, tiled };
            return if stage.entry == Entry::Points { Ok(cover) } else { cover.checked(pass, limits) };
        }
        let cpu = limits.profile == Profile::Cpu;
        let small = matches!(shape, Shape::Image(t) if t.channels < 4 || t.precision == Precision::F16);
        let (size, each, axis) = match position {
            // So that what bounds the loops of a thread bounds those of one pixel.
            "vec2i" if cpu && super::has_bounded_loops(pass) => ([64, 1, 1], 1, 1),
            "vec2i" if cpu => {
                let columns = elements[0].div_ceil(64);
                let rows = [8, 4, 2].into_iter().find(|r| columns * elements[1].div_ceil(*r) >= 16).unwrap_or(1);
                ([64, 1, 1], rows, 1)
            }
            "vec2i" => ([8, 8, 1], if small { 4 } else { 1 }, 0),
            "vec3i" if cpu => ([64, 1, 1], 1, 0),
            "vec3i" => ([4, 4, 4], 1, 0),
            _ if cpu => ([64, 1, 1], 1, 0),
            // Long tables, such as the words of a file, are bound by threads too.
            _ => ([256, 1, 1], if elements[0] >= LONG_TABLE { 4 } else { 1 }, 0),
        };
        let mut cover = Self { elements, size, each, axis, groups: [0; 3], row: None, position, tiled };
        cover.groups = cover.groups_of(elements);
        if position == "i32" && cover.groups[0] > limits.max_groups {
            cover.row = Some(limits.max_groups);
            cover.groups = cover.groups_of(elements);
        }
        cover.checked(pass, limits)
    }

    /// Workgroups that cover so many elements: a part of the grid, no larger than the whole.
    pub(crate) fn groups_of(&self, elements: [u32; 3]) -> [u32; 3] {
        let per_group = |i: usize| self.size[i] * if i == self.axis { self.each } else { 1 };
        let [x, y, z] = std::array::from_fn(|i| elements[i].div_ceil(per_group(i)).max(1));
        match self.row {
            Some(row) if x > row => [row, x.div_ceil(row), z],
            _ => [x, y, z],
        }
    }

    fn checked(self, pass: &KernelPass, limits: &Limits) -> Result<Self, PlanError> {
        if self.groups.iter().any(|g| *g > limits.max_groups) {
            return Err(PlanError::TooManyGroups { name: pass.name.clone(), groups: self.groups, most: limits.max_groups });
        }
        Ok(self)
    }
}

/// The type that a shader's `at` or `each` takes. It says so itself; `apply` always stands on an image.
fn position(entry: Entry, source: &str, shape: Shape) -> &'static str {
    let name = match entry {
        Entry::At => "fn at(",
        Entry::Each => "fn each(",
        _ => "",
    };
    let declared = (!name.is_empty()).then(|| source.find(name)).flatten().and_then(|at| {
        let rest = &source[at + name.len()..];
        let ty = rest[..rest.find(')')?].split(':').nth(1)?.trim();
        ["vec2i", "vec3i", "i32"].into_iter().find(|t| *t == ty)
    });
    declared.unwrap_or(match shape {
        Shape::Image(_) => "vec2i",
        Shape::Volume(_) => "vec3i",
        _ => "i32",
    })
}

/// The main module of everything but a `Kernel` and folds.
pub(super) fn main_module(pass: &KernelPass, cover: &Cover, ops: &Ops, index: &dyn Fn(ResourceId, bool) -> usize) -> String {
    let main = pass.stages.len() - 1;
    let stage = pass.last();
    let bind: String = layout::bind_calls(pass).iter().map(|call| format!("    {call}\n")).collect();
    if stage.entry == Entry::Points {
        return format!(
            "@vertex\nfn vertex_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{\n{bind}\
             \x20   let v = package::s{main}::vertex(i);\n\
             \x20   return select(v, vec4f(2.0, 2.0, 2.0, 1.0), v.w == 0.0);\n}}\n\
             @fragment\nfn fragment_main() -> @location(0) vec4f {{\n{bind}    return package::s{main}::fragment();\n}}\n"
        );
    }
    let body = match stage.entry {
        Entry::Point => {
            let mut body = stage_calls(pass, index);
            for write in &pass.writes {
                let _ = writeln!(body, "package::io::put_r{}(at, v{});", index(write.resource, true), write.stage);
            }
            body
        }
        Entry::At => {
            let w = index(pass.writes[0].resource, true);
            match ops.shape(pass.writes[0].resource) {
                Shape::Scalar => format!("package::io::put_r{w}(0, package::s{main}::at(at));"),
                _ => format!("package::io::put_r{w}(at, package::s{main}::at(at));"),
            }
        }
        _ => format!("package::s{main}::each(at);"),
    };
    let [sx, sy, sz] = cover.size;
    let [nx, ny, nz] = cover.elements;
    let mut text = format!(
        "@compute @workgroup_size({sx}, {sy}, {sz})\n\
         fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {{\n{bind}"
    );
    match cover.position {
        "i32" => {
            let (each, per_group) = (cover.each, sx * cover.each);
            let row = cover.groups[0] * per_group;
            let _ = write!(
                text,
                "    let start = i32(group.y * {row}u + group.x * {per_group}u + local.x);\n\
                 \x20   for (var t = 0; t < {each}; t++) {{\n        let at = start + t * {sx};\n        if at < {nx} {{ {body} }}\n    }}\n"
            );
        }
        "vec3i" => {
            let _ = write!(
                text,
                "    let at = vec3i(group * vec3u({sx}u, {sy}u, {sz}u) + local);\n    if all(at < vec3i({nx}, {ny}, {nz})) {{ {body} }}\n"
            );
        }
        _ => {
            // The size of a covered image is asked from the image, so that one kernel serves all sizes.
            let (first, end) = match pass.grid {
                _ if cover.tiled => ("package::io::uniforms.grid_first + ", "package::io::uniforms.grid_end".to_owned()),
                Grid::Cover => ("", format!("package::io::size_r{}()", index(pass.writes[0].resource, true))),
                _ => ("", format!("vec2i({nx}, {ny})")),
            };
            let each = cover.each;
            let (px, py) = if cover.axis == 0 { (sx * each, sy) } else { (sx, sy * each) };
            // Neighbouring threads take neighbouring pixels; a thread's own pixels lie a group apart along x, and
            // one below the other along y.
            let step = if cover.axis == 0 { format!("vec2i(t * {sx}, 0)") } else { "vec2i(0, t)".to_owned() };
            let _ = write!(
                text,
                "    let end = {end};\n\
                 \x20   let start = {first}vec2i(group.xy * vec2u({px}u, {py}u) + local.xy{});\n\
                 \x20   for (var t = 0; t < {each}; t++) {{\n        let at = start + {step};\n        if all(at < end) {{ {body} }}\n    }}\n",
                if cover.axis == 1 && sy > 1 { format!(" * vec2u(1u, {each}u)") } else { String::new() },
            );
        }
    }
    text.push_str("}\n");
    text
}

/// Every stage once for the pixel `at`, in order, each result in a variable of its own, so that nothing is computed or loaded
/// twice.
pub(super) fn stage_calls(pass: &KernelPass, index: &dyn Fn(ResourceId, bool) -> usize) -> String {
    let mut body = String::from("package::io::current = at;\n");
    let mut loaded: Vec<usize> = Vec::new();
    for (s, stage) in pass.stages.iter().enumerate() {
        let mut args = Vec::new();
        for port in stage.ports.iter().filter(|p| matches!(p.shape, Shape::Image(_))) {
            args.push(match port.source {
                Source::Read(r) => {
                    let i = index(pass.reads[r], false);
                    if !loaded.contains(&i) {
                        loaded.push(i);
                        let _ = writeln!(body, "let l{i} = package::io::fetch_r{i}(at);");
                    }
                    format!("l{i}")
                }
                Source::Stage(k) => format!("v{k}"),
            });
        }
        let args = args.join(", ");
        let _ = match stage.entry {
            Entry::Fold(_) => writeln!(body, "{}", walk::take(s, stage, &args)),
            _ => writeln!(body, "let v{s} = {};", narrow(&format!("package::s{s}::apply({args})"), stage.shape)),
        };
    }
    body
}
