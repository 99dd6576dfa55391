//! Graph → PassGraph: every node declares its passes; edges become resources.
//!
//! The rim is added here: graph inputs are decoded from the words that a file holds, outputs are packed into the
//! words that a file will hold. `repeat` and `Iterate` become loops, `Feedback` a history kept by the executor.

use std::collections::HashMap;

use indexmap::IndexMap;
use pipe_graph::graph::{Graph, Instance, Iteration, Times, ValueRef, Work};
use pipe_graph::lowering::{Carried, Lowering, Site};
use pipe_graph::node::{FileSource, Mistake, Output};
use pipe_graph::pass::{Border, Count, Filter, Item, Kept, Limits, Loop, NodeLabel, Origin, PassGraph, Resource, ResourceId, Shape, State};
use pipe_graph::rim::{self, PixelForm, VoxelForm};
use pipe_graph::types::{EdgeType, ImageType};

use crate::PlanError;

/// How the world outside the GPU holds what goes in and comes out, and which frame it is.
#[derive(Debug, Clone, Default)]
pub struct Rim {
    /// Pixels of graph inputs, by name, and of files that nodes read, by [`file_name`]; linear floats when absent.
    pub inputs: IndexMap<String, PixelForm>,
    /// Voxels of volumes, by the same names; plain floats when absent.
    pub volumes: IndexMap<String, VoxelForm>,
    /// Pixels wanted of image outputs; linear floats when absent.
    pub outputs: IndexMap<String, PixelForm>,
    /// More values to fetch (`--dump`), by the name they are asked by.
    pub dumps: IndexMap<String, ValueRef>,
    /// How many frames ran before this one: a `Feedback` has its initial value for the first `delay` of them.
    pub frames_before: u32,
    /// `--seed`
    pub seed: u64,
}

/// The name under which the executor asks for a file that a node reads.
pub fn file_name(source: &FileSource) -> String {
    match source {
        FileSource::Image(path) => format!("image:{path}"),
        FileSource::Volume(path) => format!("volume:{path}"),
    }
}

/// The name under which the `readback` option of a node is fetched.
pub fn readback_name(instance: &Instance) -> String {
    format!("{}:readback", instance.name)
}

/// Lowers a graph.
pub fn lower(graph: &Graph, rim: &Rim, limits: &Limits) -> Result<PassGraph, PlanError> {
    let mut lowerer = Lowerer { passes: PassGraph::default(), rim, limits, files: HashMap::new(), decoding: Vec::new(), depth: 0 };
    let mut values = HashMap::new();
    let mut items = lowerer.region(graph, &mut values)?;
    let outputs = graph.outputs().map(|(name, value)| (name.to_owned(), value));
    let dumps = rim.dumps.iter().map(|(name, value)| (name.clone(), *value));
    let readbacks = graph.iter().filter(|(_, i)| i.options.readback.is_some() && !i.outputs.is_empty());
    let readbacks = readbacks.map(|(node, i)| (readback_name(i), ValueRef { node, port: 0 }));
    for (name, value) in outputs.chain(dumps).chain(readbacks).collect::<Vec<_>>() {
        items.extend(lowerer.fetch(&name, values[&value], graph.ty(value)));
    }
    for (_, instance) in graph.iter() {
        if let Work::Feedback { next, delay, .. } = instance.work
            && let Carried::One(id) = values[&next]
        {
            lowerer.passes.kept.push(Kept { name: instance.name.clone(), resource: id, delay });
        }
    }
    lowerer.passes.items = std::mem::take(&mut lowerer.decoding);
    lowerer.passes.items.extend(items);
    Ok(lowerer.passes)
}

struct Lowerer<'a> {
    passes: PassGraph,
    rim: &'a Rim,
    limits: &'a Limits,
    /// Files that nodes read, and the passes that decode them, which come before everything else.
    files: HashMap<String, ResourceId>,
    decoding: Vec<Item>,
    /// Iterations around what is being lowered.
    depth: u32,
}

type Values = HashMap<ValueRef, Carried>;

impl Lowerer<'_> {
    fn label(&mut self, name: &str) -> NodeLabel {
        self.passes.nodes.push(name.to_owned());
        NodeLabel(self.passes.nodes.len() as u32 - 1)
    }

    /// Lowers the instances of a graph or of an iteration's body.
    fn region(&mut self, graph: &Graph, values: &mut Values) -> Result<Vec<Item>, PlanError> {
        let mut items = Vec::new();
        for (node, instance) in graph.iter() {
            match &instance.work {
                Work::Input => {
                    let (name, ty) = (instance.name.clone(), instance.outputs[0].ty);
                    let id = self.source(&name, ty, &mut items);
                    values.insert(ValueRef { node, port: 0 }, Carried::One(id));
                }
                Work::Node(_) => items.extend(self.node(graph, node, instance, values)?),
                Work::Iterate(iteration) => items.push(self.iterate(node, instance, iteration, values)?),
                Work::Feedback { delay, .. } => {
                    let init = values[&instance.inputs[0]];
                    let value = if self.rim.frames_before < *delay { init } else { self.recall(instance, *delay) };
                    values.insert(ValueRef { node, port: 0 }, value);
                }
                // Placed by whoever lowers the body.
                Work::State(_) | Work::Capture(_) => {}
            }
        }
        Ok(items)
    }

    /// Something that the host supplies.
    fn source(&mut self, name: &str, ty: EdgeType, items: &mut Vec<Item>) -> ResourceId {
        let label = self.label(name);
        let form = |t: ImageType| self.rim.inputs.get(name).copied().unwrap_or(PixelForm::linear(t.size, t.channels));
        let site = rim_site(label, name, self.limits);
        match ty {
            EdgeType::Image(t) => {
                let form = form(t);
                let mut cx = Lowering::new(&mut self.passes, &site);
                let id = rim::ingest_image(&mut cx, name, &form);
                items.extend(cx.finish().0);
                id
            }
            EdgeType::Volume(t) => {
                let form = self.rim.volumes.get(name).copied().unwrap_or(VoxelForm::plain(t.size, t.channels));
                let mut cx = Lowering::new(&mut self.passes, &site);
                let id = rim::ingest_volume(&mut cx, name, &form);
                items.extend(cx.finish().0);
                id
            }
            EdgeType::Table(t) => {
                let shape = Shape::Table { len: t.len, element: t.element };
                let origin = Origin::External { name: name.to_owned(), ranges: vec![0..shape.bytes()] };
                self.passes.add(Resource { name: name.to_owned(), shape, origin })
            }
            EdgeType::Scalar(_) | EdgeType::Mesh(_) => unreachable!("the parser takes no such input"),
        }
    }

    fn node(
        &mut self,
        graph: &Graph,
        node: petgraph::graph::NodeIndex,
        instance: &Instance,
        values: &mut Values,
    ) -> Result<Vec<Item>, PlanError> {
        let Work::Node(work) = &instance.work else { unreachable!("asked for nodes only") };
        let mut items = Vec::new();
        let file = match work.file() {
            None => None,
            Some(source) => {
                let ty = instance.outputs[0].ty;
                let name = file_name(&source);
                Some(match self.files.get(&name) {
                    Some(id) => *id,
                    None => {
                        let mut decoding = std::mem::take(&mut self.decoding);
                        let id = self.source(&name, ty, &mut decoding);
                        self.decoding = decoding;
                        self.files.insert(name, id);
                        id
                    }
                })
            }
        };
        let label = self.label(&instance.name);
        let types: Vec<EdgeType> = instance.inputs.iter().map(|v| graph.ty(*v)).collect();
        let mut inputs: Vec<Carried> = instance.inputs.iter().map(|v| values[v]).collect();
        let times = instance.options.repeat.unwrap_or(1);
        let init = inputs.first().copied();
        let carried = match (times, init) {
            (2.., Some(Carried::One(init))) => {
                let Resource { name, .. } = self.passes.resource(init).clone();
                // The state has the shape of what the node makes, which differs from the input at most in precision.
                let shape = Shape::of_edge(&instance.outputs[0].ty).expect("a mesh node cannot repeat");
                let carried = self.passes.add(Resource { name: format!("{name}.before"), shape, origin: Origin::State });
                inputs[0] = Carried::One(carried);
                Some((init, carried, shape))
            }
            _ => None,
        };
        let site = Site {
            name: &instance.name,
            label,
            inputs: &inputs,
            types: &types,
            outputs: &instance.outputs,
            file,
            limits: self.limits,
            border: instance.options.border,
            filter: instance.options.filter,
            seed: self.rim.seed,
            frames_before: (self.depth == 0 && times == 1).then_some(self.rim.frames_before),
        };
        let mut cx = Lowering::new(&mut self.passes, &site);
        work.lower(&mut cx).map_err(|m| refused(&instance.name, &m))?;
        let (own, emitted) = cx.finish();
        let port =
            |name: &str| emitted.get(name).copied().ok_or_else(|| refused(&instance.name, &Mistake::new(format!("makes no `{name}`"))));
        let mut out: Vec<Carried> = instance.outputs.iter().map(|o: &Output| port(&o.name)).collect::<Result<_, _>>()?;
        match carried {
            None => items.extend(own),
            // What leaves an image as it is leaves it so however often.
            Some((init, carried, shape)) if out == [Carried::One(carried)] && self.passes.resource(init).shape == shape => {
                out[0] = Carried::One(init);
            }
            Some((init, carried, shape)) => {
                let Some(Carried::One(next)) = out.first().copied() else { unreachable!("the resolver checked the first port") };
                let result = self.passes.add(Resource { name: format!("{}.after", instance.name), shape, origin: Origin::State });
                let mut states = vec![State { init, carried, next, result }];
                out[0] = Carried::One(result);
                // The other ports leave the loop as states that nobody reads inside.
                for value in &mut out[1..] {
                    if let Carried::One(next) = *value {
                        let shape = self.passes.resource(next).shape;
                        let name = self.passes.resource(next).name.clone();
                        let mut add = |what: &str, origin| self.passes.add(Resource { name: format!("{name}.{what}"), shape, origin });
                        let (carried, result) = (add("before", Origin::State), add("after", Origin::State));
                        states.push(State { init: next, carried, next, result });
                        *value = Carried::One(result);
                    }
                }
                items.push(Item::Loop(Loop { name: instance.name.clone(), node: label, states, body: own, count: Count::Fixed(times) }));
            }
        }
        for (port, value) in out.into_iter().enumerate() {
            values.insert(ValueRef { node, port }, value);
        }
        Ok(items)
    }

    fn iterate(
        &mut self,
        node: petgraph::graph::NodeIndex,
        instance: &Instance,
        iteration: &Iteration,
        values: &mut Values,
    ) -> Result<Item, PlanError> {
        let label = self.label(&instance.name);
        let mut inside = Values::new();
        let mut carried = Vec::new();
        for (at, inner) in iteration.body.iter() {
            let value = match inner.work {
                Work::State(n) => {
                    let shape = Shape::of_edge(&instance.outputs[n].ty)
                        .ok_or_else(|| refused(&instance.name, &Mistake::new("a mesh cannot be a state")))?;
                    let name = format!("{}.{}", instance.name, instance.outputs[n].name);
                    let id = self.passes.add(Resource { name, shape, origin: Origin::State });
                    carried.push((n, id));
                    Carried::One(id)
                }
                Work::Capture(n) => values[&instance.inputs[instance.outputs.len() + n]],
                _ => continue,
            };
            inside.insert(ValueRef { node: at, port: 0 }, value);
        }
        carried.sort_unstable();
        self.depth += 1;
        let body = self.region(&iteration.body, &mut inside);
        self.depth -= 1;
        let body = body?;
        let one = |c: Carried| match c {
            Carried::One(id) => id,
            Carried::Mesh(_) => unreachable!("states are not meshes"),
        };
        let mut states = Vec::new();
        for (n, id) in carried {
            let next = one(inside[&iteration.next[n]]);
            let Resource { name, shape, .. } = self.passes.resource(id).clone();
            let result = self.passes.add(Resource { name: format!("{name}.after"), shape, origin: Origin::State });
            states.push(State { init: one(values[&instance.inputs[n]]), carried: id, next, result });
            values.insert(ValueRef { node, port: n }, Carried::One(result));
        }
        let count = match iteration.times {
            Times::Fixed(n) => Count::Fixed(n),
            Times::Until { value, limit, every, max } => Count::Until { value: one(inside[&value]), limit, every, max },
        };
        Ok(Item::Loop(Loop { name: instance.name.clone(), node: label, states, body, count }))
    }

    fn recall(&mut self, instance: &Instance, delay: u32) -> Carried {
        let shape = Shape::of_edge(&instance.outputs[0].ty).expect("the resolver refuses meshes here");
        let origin = Origin::History { name: instance.name.clone(), delay };
        Carried::One(self.passes.add(Resource { name: instance.name.clone(), shape, origin }))
    }

    /// Brings a value back to the host under a name.
    fn fetch(&mut self, name: &str, value: Carried, ty: EdgeType) -> Vec<Item> {
        let label = self.label(name);
        let site = rim_site(label, name, self.limits);
        let form = self.rim.outputs.get(name).copied();
        let mut cx = Lowering::new(&mut self.passes, &site);
        match (value, ty) {
            (Carried::One(id), EdgeType::Image(t)) => {
                rim::fetch_image(&mut cx, name, id, &form.unwrap_or(PixelForm::linear(t.size, t.channels)));
            }
            (Carried::One(id), EdgeType::Volume(_)) => rim::fetch_volume(&mut cx, name, id),
            (Carried::One(id), _) => rim::fetch_words(&mut cx, name, id),
            (Carried::Mesh(parts), _) => {
                rim::fetch_words(&mut cx, &format!("{name}.vertices"), parts.vertices);
                rim::fetch_words(&mut cx, &format!("{name}.triangles"), parts.triangles);
                rim::fetch_words(&mut cx, &format!("{name}.counts"), parts.counts);
            }
        }
        cx.finish().0
    }
}

/// The site of a pass at the rim, which belongs to no node.
fn rim_site<'s>(label: NodeLabel, name: &'s str, limits: &'s Limits) -> Site<'s> {
    Site {
        name,
        label,
        inputs: &[],
        types: &[],
        outputs: &[],
        file: None,
        limits,
        border: Border::Clamp,
        filter: Filter::Linear,
        seed: 0,
        frames_before: None,
    }
}

fn refused(name: &str, mistake: &Mistake) -> PlanError {
    let field = mistake.field.as_ref().map(|f| format!("{f} ")).unwrap_or_default();
    let hint = mistake.hint.as_ref().map(|h| format!("\n  next: {h}")).unwrap_or_default();
    PlanError::Node { name: name.to_owned(), message: format!("{field}{}{hint}", mistake.message) }
}
