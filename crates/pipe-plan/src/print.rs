//! The plan as text, JSON, DOT and SVG: the same bytes on every machine.

use std::fmt::Write as _;

use pipe_graph::pass::ResourceId;
use pipe_graph::types::{ImageType, Precision, VolumeType};
use serde_json::{Value, json};

use crate::kernel_pass::{Op, Ops};
use crate::plan::{Plan, Rect, Repeat, Run, Step, Storage, Tiling, Times};

/// One launch with what runs it again and again.
struct Line<'p> {
    run: &'p Run,
    around: Vec<Around<'p>>,
}

/// What runs a launch again and again.
#[derive(Clone, Copy)]
enum Around<'p> {
    Loop(&'p Repeat),
    Tiles(&'p Tiling),
}

impl Around<'_> {
    fn name(&self) -> &str {
        match self {
            Self::Loop(r) => &r.name,
            Self::Tiles(t) => &t.name,
        }
    }

    fn times(&self) -> String {
        match self {
            Self::Loop(r) => describe(&r.count),
            Self::Tiles(t) => format!("{} tiles of {}x{}", t.tiles.len(), t.step[0], t.step[1]),
        }
    }
}

impl Storage {
    /// `rgba32float`, `buffer`
    pub fn format(&self) -> String {
        match self {
            Self::Image(ImageType { channels, precision, .. }) | Self::Volume(VolumeType { channels, precision, .. }) => {
                let names = ["", "r", "rg", "", "rgba"];
                let bits = if *precision == Precision::F16 { 16 } else { 32 };
                format!("{}{bits}float", names[*channels as usize])
            }
            Self::Buffer { .. } => "buffer".to_owned(),
        }
    }

    /// `[w, h]`, `[w, h, d]` or `[bytes]`.
    pub fn extent(&self) -> Vec<u64> {
        match self {
            Self::Image(t) => t.size.iter().map(|n| u64::from(*n)).collect(),
            Self::Volume(t) => t.size.iter().map(|n| u64::from(*n)).collect(),
            Self::Buffer { bytes } => vec![*bytes],
        }
    }
}

impl Plan {
    fn lines(&self) -> Vec<Line<'_>> {
        fn walk<'p>(steps: &'p [Step], around: &mut Vec<Around<'p>>, lines: &mut Vec<Line<'p>>) {
            for step in steps {
                let (outer, body) = match step {
                    Step::Run(run) => {
                        lines.push(Line { run, around: around.clone() });
                        continue;
                    }
                    // The other two copies of the body do the same over other slots.
                    Step::Repeat(r) => (Around::Loop(r), &r.first),
                    Step::Tiles(t) => (Around::Tiles(t), &t.body),
                };
                around.push(outer);
                walk(body, around, lines);
                around.pop();
            }
        }
        let mut lines = Vec::new();
        walk(&self.steps, &mut Vec::new(), &mut lines);
        lines
    }

    /// The tiling at a position of the steps.
    pub fn tilings_at(&self, step: usize) -> Option<&Tiling> {
        self.steps.get(step).and_then(|step| if let Step::Tiles(t) = step { Some(t) } else { None })
    }

    /// What is made tile by tile.
    pub fn tilings(&self) -> impl Iterator<Item = &Tiling> {
        self.steps.iter().filter_map(|step| if let Step::Tiles(t) = step { Some(t) } else { None })
    }

    /// The number of launches, each loop's body counted once.
    pub fn pass_count(&self) -> usize {
        self.lines().len()
    }

    /// A table for people.
    pub fn to_text(&self) -> String {
        let mut out = format!("plan of {}\n\npasses\n", self.name);
        for (i, line) in self.lines().iter().enumerate() {
            let run = line.run;
            let indent = "  ".repeat(line.around.len());
            let times: String = line.around.last().map(|a| format!("  [{}: {}]", a.name(), a.times())).unwrap_or_default();
            let _ = writeln!(
                out,
                "{:>4}  {indent}{}  ({})  {} -> {}  slots {}  groups {}x{}x{}  {}{times}",
                i + 1,
                run.name,
                self.kernels[run.kernel.0 as usize].label,
                run.reads.join(", "),
                run.writes.join(", "),
                run.slots.iter().map(|s| s.0.to_string()).collect::<Vec<_>>().join(","),
                run.groups[0],
                run.groups[1],
                run.groups[2],
                bytes(run.bytes),
            );
        }
        if self.tilings().next().is_some() {
            out.push_str("\ntiles\n");
        }
        for t in self.tilings() {
            let [columns, rows] = t.layout();
            let _ = writeln!(
                out,
                "      {}: {}x{} in {columns}x{rows} tiles of {}x{}, {:.2} pixels computed for each",
                t.name, t.size[0], t.size[1], t.step[0], t.step[1], t.work
            );
        }
        out.push_str("\nslots\n");
        for (i, slot) in self.slots.iter().enumerate() {
            let extent: Vec<String> = slot.storage.extent().iter().map(u64::to_string).collect();
            let _ = writeln!(out, "{i:>4}  {:<12} {:>16}  {:>10}", slot.storage.format(), extent.join("x"), bytes(slot.storage.bytes()));
        }
        let _ = writeln!(
            out,
            "\npeak {}  without sharing {}  moved {}",
            bytes(self.peak_bytes),
            bytes(self.naive_bytes),
            bytes(self.bytes_moved)
        );
        out
    }

    /// `{graph, size, passes, slots, peak_bytes, naive_bytes, bytes_moved}`; keys as fixed in the design. A plan knows the sizes of
    /// its slots, which may hold packed pixels; `size` is what the graph's picture has.
    pub fn to_json(&self, size: &[u32]) -> Value {
        let pass = |line: &Line<'_>| {
            let run = line.run;
            let mut pass = json!({
                "name": run.name,
                "nodes": run.nodes,
                "reads": run.reads,
                "writes": run.writes,
                "slot": run.slots.iter().map(|s| s.0).collect::<Vec<_>>(),
                "grid": run.groups,
            });
            if let (Some(a), Some(object)) = (line.around.last(), pass.as_object_mut()) {
                let key = if matches!(a, Around::Loop(_)) { "loop" } else { "tiles" };
                object.insert(key.into(), json!(a.name()));
                object.insert("times".into(), json!(a.times()));
            }
            pass
        };
        let slot = |(id, s): (usize, &crate::plan::Slot)| json!({"id": id, "format": s.storage.format(), "size": s.storage.extent(), "bytes": s.storage.bytes()});
        let tiling = |t: &Tiling| json!({"name": t.name, "size": t.size, "tile": t.step, "layout": t.layout(), "work": t.work});
        json!({
            "graph": self.name,
            "size": size,
            "passes": self.lines().iter().map(pass).collect::<Vec<_>>(),
            "slots": self.slots.iter().enumerate().map(slot).collect::<Vec<_>>(),
            "tilings": self.tilings().map(tiling).collect::<Vec<_>>(),
            "peak_bytes": self.peak_bytes,
            "naive_bytes": self.naive_bytes,
            "bytes_moved": self.bytes_moved,
        })
    }

    /// Passes and the resources between them, for Graphviz.
    pub fn to_dot(&self) -> String {
        let mut out = format!("digraph {:?} {{\n  rankdir=LR;\n  node [fontname=\"sans-serif\"];\n", self.name);
        let mut resources: Vec<&str> = Vec::new();
        for (i, line) in self.lines().iter().enumerate() {
            let _ = writeln!(out, "  p{i} [shape=box, label={:?}];", line.run.name);
            for (names, reads) in [(&line.run.reads, true), (&line.run.writes, false)] {
                for name in names {
                    let id = resources.iter().position(|r| r == name).unwrap_or_else(|| {
                        resources.push(name);
                        resources.len() - 1
                    });
                    let _ = if reads { writeln!(out, "  r{id} -> p{i};") } else { writeln!(out, "  p{i} -> r{id};") };
                }
            }
        }
        for (id, name) in resources.iter().enumerate() {
            let _ = writeln!(out, "  r{id} [shape=ellipse, label={name:?}];");
        }
        for (t, tiling) in self.tilings().enumerate() {
            let inside = |line: &Line<'_>| line.around.iter().any(|a| matches!(a, Around::Tiles(other) if std::ptr::eq(*other, tiling)));
            let passes: String = self.lines().iter().enumerate().filter(|(_, l)| inside(l)).map(|(i, _)| format!(" p{i};")).collect();
            let _ = writeln!(out, "  subgraph cluster{t} {{ label={:?};{passes} }}", Around::Tiles(tiling).times());
        }
        out.push_str("}\n");
        out
    }

    /// Passes from left to right, a row for each slot, a bar where the slot is written or read.
    pub fn to_svg(&self) -> String {
        const STEP: usize = 36;
        const ROW: usize = 22;
        const LEFT: usize = 220;
        const LAYOUT: usize = 160;
        let lines = self.lines();
        let layouts = 150 + ROW * self.slots.len() + 20;
        let height = layouts + (LAYOUT + 40) * self.tilings().count();
        let width = LEFT + STEP * lines.len().max(1) + 20;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n<text x=\"10\" y=\"16\">{}: peak {}, without sharing {}</text>\n",
            escape(&self.name),
            bytes(self.peak_bytes),
            bytes(self.naive_bytes)
        );
        for (i, line) in lines.iter().enumerate() {
            let x = LEFT + i * STEP + STEP / 2;
            let _ = writeln!(out, "<text transform=\"translate({x},140) rotate(-60)\">{}</text>", escape(&line.run.name));
        }
        for (s, slot) in self.slots.iter().enumerate() {
            let y = 150 + s * ROW;
            let extent: Vec<String> = slot.storage.extent().iter().map(u64::to_string).collect();
            let _ = writeln!(
                out,
                "<text x=\"10\" y=\"{}\">{s}: {} {} ({})</text>",
                y + 14,
                slot.storage.format(),
                extent.join("x"),
                bytes(slot.storage.bytes())
            );
            let uses: Vec<usize> =
                lines.iter().enumerate().filter(|(_, l)| l.run.slots.iter().any(|id| id.0 as usize == s)).map(|(i, _)| i).collect();
            if let (Some(first), Some(last)) = (uses.first(), uses.last()) {
                let x = LEFT + first * STEP;
                let _ = writeln!(
                    out,
                    "<rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" fill=\"#9ecae1\"/>",
                    (last - first + 1) * STEP,
                    ROW - 4
                );
                for i in &uses {
                    let _ = writeln!(
                        out,
                        "<rect x=\"{}\" y=\"{y}\" width=\"{STEP}\" height=\"{}\" fill=\"#3182bd\" fill-opacity=\"0.6\"/>",
                        LEFT + i * STEP,
                        ROW - 4
                    );
                }
            }
        }
        for (i, tiling) in self.tilings().enumerate() {
            let top = layouts + i * (LAYOUT + 40);
            let [columns, rows] = tiling.layout();
            let _ = writeln!(
                out,
                "<text x=\"10\" y=\"{}\">{}: {}x{} in {columns}x{rows} tiles of {}x{}</text>",
                top + 12,
                escape(&tiling.name),
                tiling.size[0],
                tiling.size[1],
                tiling.step[0],
                tiling.step[1]
            );
            layout(&mut out, tiling, [10, top + 20], LAYOUT as f64);
        }
        out.push_str("</svg>\n");
        out
    }
}

/// The tiles of an image, and around the middle one what is uploaded for it, in a square of this side.
fn layout(out: &mut String, tiling: &Tiling, at: [usize; 2], side: f64) {
    let scale = side / f64::from(tiling.size[0].max(tiling.size[1]));
    let place = |n: u32, axis: usize| at[axis] as f64 + f64::from(n) * scale;
    let rectangle = |r: &Rect, style: &str| {
        let [w, h] = r.size().map(|n| f64::from(n) * scale);
        let (x, y) = (place(r.x.start, 0), place(r.y.start, 1));
        format!("<rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"{w:.2}\" height=\"{h:.2}\" {style}/>\n")
    };
    let whole = Rect { x: 0..tiling.size[0], y: 0..tiling.size[1] };
    out.push_str(&rectangle(&whole, "fill=\"#deebf7\" stroke=\"black\" stroke-width=\"0.5\""));
    let cuts = |axis: usize| (0..tiling.size[axis]).step_by(tiling.step[axis] as usize).skip(1);
    let (right, bottom) = (place(tiling.size[0], 0), place(tiling.size[1], 1));
    let mut line = |[x1, y1, x2, y2]: [f64; 4]| {
        let _ =
            writeln!(out, "<line x1=\"{x1:.2}\" y1=\"{y1:.2}\" x2=\"{x2:.2}\" y2=\"{y2:.2}\" stroke=\"#3182bd\" stroke-width=\"0.5\"/>");
    };
    cuts(0).for_each(|x| line([place(x, 0), place(0, 1), place(x, 0), bottom]));
    cuts(1).for_each(|y| line([place(0, 0), place(y, 1), right, place(y, 1)]));
    let [columns, rows] = tiling.layout();
    let middle = tiling.tiles.get((rows / 2 * columns + columns / 2) as usize);
    for upload in middle.iter().flat_map(|tile| &tile.uploads) {
        out.push_str(&rectangle(&upload.rect, "fill=\"#3182bd\" fill-opacity=\"0.4\""));
    }
}

/// Passes before slots are known.
pub(crate) fn ops(ops: &Ops) -> String {
    fn walk(list: &[Op], ops: &Ops, depth: usize, out: &mut String) {
        let indent = "  ".repeat(depth);
        let names = |ids: &mut dyn Iterator<Item = ResourceId>| -> String {
            ids.map(|id| ops.resources[id.index()].name.clone()).collect::<Vec<_>>().join(", ")
        };
        for op in list {
            match op {
                Op::Pass(p) => {
                    let shaders: Vec<&str> = p.stages.iter().map(|s| &*s.shader.path).collect();
                    let reads = names(&mut p.reads.iter().copied().chain(p.drivers()));
                    let writes = names(&mut p.writes.iter().map(|w| w.resource));
                    let _ = writeln!(out, "{indent}{}  ({})  {reads} -> {writes}", p.name, shaders.join(" + "));
                }
                Op::Loop(l) => {
                    let _ = writeln!(out, "{indent}{}  {:?}", l.name, l.count);
                    walk(&l.body, ops, depth + 1, out);
                }
            }
        }
    }
    let mut out = String::new();
    walk(&ops.ops, ops, 0, &mut out);
    out
}

fn describe(times: &Times) -> String {
    match times {
        Times::Fixed(n) => format!("{n}"),
        Times::Until { limit, every, max, .. } => format!("until below {limit}, every {every}, at most {max}"),
    }
}

fn bytes(n: u64) -> String {
    match n {
        0..1024 => format!("{n} B"),
        1024..1_048_576 => format!("{:.1} KiB", n as f64 / 1024.0),
        _ => format!("{:.1} MiB", n as f64 / 1_048_576.0),
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
