//! Random pass graphs over everything that a pass can declare.
//!
//! A graph is made from a *recipe*, a list of choices, each of which adds a pass, a loop or something to fetch. A choice names
//! what it reads by how far back it lies, so that every part of a recipe is a recipe too and failures shrink to a few passes.

use std::collections::BTreeSet;

use indexmap::IndexMap;
use pipe_graph::pass::{
    Access, Border, Constant, Count, Entry, Fetch, Filter, Grid, Item, Kept, Loop, NodeLabel, Origin, Pass, PassGraph, Reach, Read,
    Resource, ResourceId, Shader, Shape, State, Stretch, Value, Values, Walk, Workspace, Write,
};
use pipe_graph::types::{ImageType, Precision, VolumeType};

/// What is added, and a number that settles the details.
pub(super) type Choice = (u8, u64);

/// Width and height of most images.
pub(super) const SIZE: [u32; 2] = [40, 26];

/// Width and height of the others.
const OTHER: [u32; 2] = [17, 9];

const BORDERS: [Border; 4] = [Border::Clamp, Border::Mirror, Border::Repeat, Border::Black];

/// How many kinds of choices there are, and how many of them may stand in a loop.
const KINDS: u8 = 28;
const KINDS_INSIDE: u8 = 22;

/// The graph of a recipe. Every pass and every resource has a name of its own.
pub(super) fn graph(recipe: &[Choice]) -> PassGraph {
    let mut maker = Maker::default();
    maker.decode(SIZE);
    for (kind, details) in recipe {
        maker.numbers = Numbers(*details);
        maker.choice(kind % KINDS);
    }
    maker.encode();
    maker.graph.items = maker.items;
    maker.graph
}

/// Numbers that follow from one (splitmix64).
#[derive(Default)]
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: u32) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % u64::from(n)) as u32
    }

    fn one_in(&mut self, n: u32) -> bool {
        self.below(n) == 0
    }

    fn of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len() as u32) as usize]
    }
}

#[derive(Default)]
struct Maker {
    graph: PassGraph,
    /// Of the region that is being made.
    items: Vec<Item>,
    /// What may be read, in the order in which it was made.
    pool: Vec<ResourceId>,
    /// What must stay as it is, since the host takes it.
    taken: BTreeSet<ResourceId>,
    /// Resources from here on belong to the loop that is being made.
    inside_from: u32,
    depth: u32,
    passes: u32,
    numbers: Numbers,
}

fn is_image(shape: Shape) -> bool {
    matches!(shape, Shape::Image(_))
}

fn is_image_of(size: [u32; 2]) -> impl Fn(Shape) -> bool {
    move |shape| matches!(shape, Shape::Image(t) if t.size == size)
}

fn is_table(shape: Shape) -> bool {
    matches!(shape, Shape::Table { .. })
}

impl Maker {
    fn choice(&mut self, kind: u8) {
        match kind {
            0..=4 => self.point(),
            5 | 6 => self.stencil(),
            7 => self.whole(),
            8 => self.several(),
            9 | 10 => self.blocks(),
            11 | 12 => self.fold(),
            13 => self.small(),
            14 => self.scalar(),
            15 => self.count(),
            16 => self.update(),
            17 => self.volume(),
            18 => self.again(),
            19 => self.band(),
            20 => self.points(),
            21 => self.repeat(),
            22 => self.repeat(),
            23 => self.decode(SIZE),
            24 => self.encode(),
            25 => self.fetch(),
            26 => self.history(),
            _ => self.literal(),
        }
    }

    fn add(&mut self, shape: Shape, origin: Origin) -> ResourceId {
        let name = format!("r{}", self.graph.resources.len());
        self.graph.add(Resource { name, shape, origin })
    }

    fn shape(&self, id: ResourceId) -> Shape {
        self.graph.resource(id).shape
    }

    /// Something that may be read: one of the last, most of the time.
    fn find(&mut self, wanted: impl Fn(Shape) -> bool) -> Option<ResourceId> {
        let found: Vec<ResourceId> = self.pool.iter().copied().filter(|id| wanted(self.shape(*id))).collect();
        let last = if self.numbers.one_in(5) { found.len() } else { found.len().min(4) };
        (!found.is_empty()).then(|| found[found.len() - 1 - self.numbers.below(last as u32) as usize])
    }

    fn size(&mut self) -> [u32; 2] {
        if self.numbers.one_in(6) { OTHER } else { SIZE }
    }

    fn image(&mut self, size: [u32; 2]) -> ResourceId {
        match self.find(is_image_of(size)) {
            Some(id) => id,
            None => {
                self.decode(size);
                *self.pool.last().expect("an image was decoded")
            }
        }
    }

    fn image_shape(&mut self, size: [u32; 2]) -> Shape {
        let precision = if self.numbers.one_in(8) { Precision::F16 } else { Precision::F32 };
        Shape::Image(ImageType { size, channels: self.numbers.of(&[4, 4, 1, 2]), precision })
    }

    fn table_shape(&mut self) -> Shape {
        let len = self.numbers.of(&[16, 16, 60]);
        if self.numbers.one_in(2) { Shape::floats(len) } else { Shape::uints(len) }
    }

    fn read(&mut self, resource: ResourceId, reach: Reach) -> Read {
        let border = self.numbers.of(&BORDERS);
        Read { port: String::new(), resource, reach, once: reach == Reach::Point, border, filter: Filter::Linear }
    }

    fn read_once(&mut self, resource: ResourceId) -> Read {
        Read { once: true, ..self.read(resource, Reach::Whole) }
    }

    /// A table or a scalar beside the images, now and then.
    fn aside(&mut self, reads: &mut Vec<Read>) {
        if self.numbers.one_in(4)
            && let Some(id) = self.find(|s| is_table(s) || s == Shape::Scalar)
        {
            reads.push(self.read(id, Reach::Whole));
        }
    }

    /// Emits a pass that makes these, from nothing unless `access` and `in_place_of` say otherwise.
    fn pass(&mut self, entry: Entry, mut reads: Vec<Read>, writes: Vec<(Shape, Access, Option<ResourceId>)>, grid: Grid) {
        for (i, read) in reads.iter_mut().enumerate() {
            read.port = format!("in{i}");
        }
        let mut made = Vec::new();
        for (i, (shape, access, in_place_of)) in writes.into_iter().enumerate() {
            let resource = self.add(shape, Origin::Pass);
            made.push(Write { port: format!("out{i}"), resource, access, in_place_of });
        }
        let mut params = IndexMap::new();
        if self.numbers.one_in(3) {
            params.insert("amount".to_owned(), Value::F32(self.numbers.below(3) as f32));
        }
        if self.numbers.one_in(4)
            && let Some(scalar) = self.find(|s| s == Shape::Scalar)
        {
            params.insert("driven".to_owned(), Value::Driven(scalar));
        }
        let mut constants = IndexMap::new();
        if self.numbers.one_in(3) {
            constants.insert("N".to_owned(), Constant::U32(self.numbers.below(2)));
        }
        let text = self.numbers.below(3);
        let shader = Shader::builtin(&format!("random/{text}.wgsl"), &format!("// {text}"));
        self.emit(Pass {
            name: String::new(),
            node: NodeLabel(0),
            shader,
            entry,
            reads,
            writes: made,
            params,
            constants,
            grid,
            values: Values::Any,
        });
    }

    /// Gives a pass its name and puts it behind the others.
    fn emit(&mut self, mut pass: Pass) {
        pass.name = format!("p{}", self.passes);
        self.passes += 1;
        self.graph.nodes.push(pass.name.clone());
        pass.node = NodeLabel(self.graph.nodes.len() as u32 - 1);
        for write in &pass.writes {
            self.pool.retain(|id| Some(*id) != write.in_place_of);
            // Pixels of a file are made for the host.
            if !matches!(self.shape(write.resource), Shape::Pixels { .. } | Shape::Words { .. }) {
                self.pool.push(write.resource);
            }
        }
        self.items.push(Item::Pass(pass));
    }

    fn decode(&mut self, size: [u32; 2]) {
        let shape = Shape::Pixels { size, pixel: self.numbers.of(&[4, 8, 2]) };
        let name = format!("file{}", self.graph.resources.len());
        let planes = 1 + u32::from(self.numbers.one_in(4));
        let mut reads = Vec::new();
        for plane in 0..u64::from(planes) {
            let bytes = shape.bytes();
            let pixels = self.add(shape, Origin::External { name: name.clone(), ranges: vec![plane * bytes..(plane + 1) * bytes] });
            reads.push(self.read(pixels, Reach::Point));
        }
        let image = self.image_shape(size);
        self.pass(Entry::Point, reads, vec![(image, Access::Store, None)], Grid::Cover);
    }

    fn point(&mut self) {
        let size = self.size();
        let mut reads = Vec::new();
        for _ in 0..self.numbers.of(&[1, 1, 1, 2, 2, 3, 0]) {
            let image = self.image(size);
            reads.push(self.read(image, Reach::Point));
        }
        self.aside(&mut reads);
        let shape = self.image_shape(size);
        self.pass(Entry::Point, reads, vec![(shape, Access::Store, None)], Grid::Cover);
    }

    fn around(&mut self) -> Reach {
        let [x, y] = self.numbers.of(&[[1, 1], [1, 0], [0, 2], [3, 1], [2, 2], [0, 1]]);
        Reach::Around(x, y)
    }

    fn stencil(&mut self) {
        let size = self.size();
        let image = self.image(size);
        let reach = self.around();
        let mut reads = vec![self.read(image, reach)];
        if self.numbers.one_in(3) {
            let other = self.image(size);
            let reach = if self.numbers.one_in(2) { Reach::Point } else { self.around() };
            reads.push(self.read(other, reach));
        }
        self.aside(&mut reads);
        let shape = self.image_shape(size);
        self.pass(Entry::At, reads, vec![(shape, Access::Store, None)], Grid::Cover);
    }

    /// Where pixels of an image of one size look in one of another: a resized one, a part of it, pixels beyond its edges,
    /// a mirrored or a turned one.
    fn elsewhere(&mut self, from: [u32; 2], to: [u32; 2]) -> Reach {
        let kind = self.numbers.below(5);
        let turned = self.numbers.one_in(4);
        let axis = |i: usize, by: i32| {
            let along = if turned { 1 - i } else { i };
            match kind {
                0 => Stretch { along, num: from[i] as i32, den: to[along], first: -2, count: 5 },
                1 => Stretch::shift(along, by),
                2 => Stretch::mirrored(along, from[i]),
                3 => Stretch { along, num: -1, den: 3, first: by + 20, count: 3 },
                _ => Stretch { along, num: 3, den: 2, first: by, count: 4 },
            }
        };
        let by = [0; 2].map(|_| self.numbers.below(60) as i32 - 30);
        Reach::Elsewhere([axis(0, by[0]), axis(1, by[1])])
    }

    /// Reads an image of whatever size, from anywhere or elsewhere.
    fn whole(&mut self) {
        let from = self.find(is_image).expect("a graph begins with an image");
        let size = self.size();
        let reach = match self.shape(from) {
            Shape::Image(t) if !self.numbers.one_in(3) => self.elsewhere(t.size, size),
            _ => Reach::Whole,
        };
        let mut reads = vec![self.read(from, reach)];
        self.aside(&mut reads);
        let shape = self.image_shape(size);
        self.pass(Entry::At, reads, vec![(shape, Access::Store, None)], Grid::Cover);
    }

    fn several(&mut self) {
        let size = self.size();
        let image = self.image(size);
        let reach = if self.numbers.one_in(2) { Reach::Point } else { self.around() };
        let reads = vec![self.read(image, reach)];
        let writes = (0..=self.numbers.below(3)).map(|_| (self.image_shape(size), Access::Store, None)).collect();
        self.pass(Entry::Each, reads, writes, Grid::Cover);
    }

    /// Blocks of pixels: images, and now and then a table beside them.
    fn blocks(&mut self) {
        let size = self.size();
        let image = self.image(size);
        let block = self.numbers.of(&[[8, 8], [64, 1], [1, 5], [16, 4]]);
        let (entry, read) = if self.numbers.one_in(2) {
            (Entry::Kernel, self.read_once(image))
        } else {
            let reach = self.around();
            (Entry::Each, self.read(image, reach))
        };
        let mut writes = vec![(self.image_shape(size), Access::Store, None)];
        if self.numbers.one_in(3) {
            writes.push((self.image_shape(size), Access::Store, None));
        }
        if self.numbers.one_in(4) {
            let shape = self.table_shape();
            writes.push((shape, Access::Store, None));
        }
        self.pass(entry, vec![read], writes, Grid::Blocks(block));
    }

    fn fold(&mut self) {
        let size = self.size();
        let image = self.image(size);
        let mut reads = vec![self.read_once(image)];
        self.aside(&mut reads);
        let shape = self.table_shape();
        let mut writes = vec![(shape, Access::Store, None)];
        if self.numbers.one_in(4) {
            writes.push((Shape::uints(16), Access::Atomic, None));
        }
        let tile = self.numbers.of(&[[16, 8], [16, 8], [32, 32]]);
        let walk = Walk { lanes: [8, 8], tile };
        let workspace = Workspace { own: self.numbers.of(&[0, 0, 4096, 16384]), scratch: self.numbers.of(&[0, 64]) };
        self.pass(Entry::Fold(workspace), reads, writes, Grid::Walk(walk));
    }

    /// A table from a table, or from an image.
    fn small(&mut self) {
        let from = self.find(|s| is_table(s) || s == Shape::Scalar).or_else(|| self.find(is_image)).expect("a graph begins with an image");
        let mut reads = vec![self.read(from, Reach::Whole)];
        self.aside(&mut reads);
        let shape = self.table_shape();
        self.pass(Entry::At, reads, vec![(shape, Access::Store, None)], Grid::Cover);
    }

    fn scalar(&mut self) {
        let from = self.find(is_table).or_else(|| self.find(is_image)).expect("a graph begins with an image");
        let reads = vec![self.read(from, Reach::Whole)];
        self.pass(Entry::At, reads, vec![(Shape::Scalar, Access::Store, None)], Grid::Cover);
    }

    /// Counts by atomic additions, beside an image now and then.
    fn count(&mut self) {
        let size = self.size();
        let image = self.image(size);
        let reads = vec![self.read_once(image)];
        let mut writes = vec![(Shape::uints(16), Access::Atomic, None)];
        if self.numbers.one_in(4) {
            writes.push((self.image_shape(size), Access::Store, None));
        }
        let block = self.numbers.of(&[[8, 8], [16, 4]]);
        self.pass(Entry::Kernel, reads, writes, Grid::Blocks(block));
    }

    /// Whether the storage of a resource may be taken over.
    fn may_update(&self, id: ResourceId) -> bool {
        let own = id.0 >= self.inside_from && !self.taken.contains(&id);
        own && matches!(self.graph.resource(id).origin, Origin::Pass | Origin::State)
    }

    fn update(&mut self) {
        let tables: Vec<ResourceId> = self.pool.iter().copied().filter(|id| is_table(self.shape(*id)) && self.may_update(*id)).collect();
        let old = (!tables.is_empty() && !self.numbers.one_in(6)).then(|| self.numbers.of(&tables));
        let shape = old.map_or(Shape::uints(16), |id| self.shape(id));
        let access = if shape == Shape::uints(16) { self.numbers.of(&[Access::Update, Access::AtomicUpdate]) } else { Access::Update };
        let mut reads = Vec::new();
        if let Some(id) = self.find(|s| is_image(s) || is_table(s)).filter(|id| Some(*id) != old) {
            reads.push(self.read(id, Reach::Whole));
        }
        self.pass(Entry::Each, reads, vec![(shape, access, old)], Grid::Elements([shape.entries(), 1, 1]));
    }

    fn volume(&mut self) {
        let size = [6, 5, 4];
        let shape = Shape::Volume(VolumeType { size, channels: self.numbers.of(&[1, 4]), precision: Precision::F32 });
        let from = self.find(|s| matches!(s, Shape::Volume(_)));
        let read = match from {
            Some(volume) => {
                let reach = self.numbers.of(&[Reach::Point, Reach::Around(1, 1), Reach::Whole]);
                self.read(volume, reach)
            }
            None => {
                let image = self.image(SIZE);
                self.read(image, Reach::Whole)
            }
        };
        if from.is_some() && self.numbers.one_in(3) {
            let image = self.image_shape(SIZE);
            let reads = vec![Read { reach: Reach::Whole, once: false, ..read }];
            self.pass(Entry::At, reads, vec![(image, Access::Store, None)], Grid::Cover);
        } else {
            self.pass(Entry::At, vec![read], vec![(shape, Access::Store, None)], Grid::Cover);
        }
    }

    /// The pass before once more.
    fn again(&mut self) {
        let Some(Item::Pass(last)) = self.items.last() else { return };
        if last
            .writes
            .iter()
            .any(|w| w.in_place_of.is_some() || matches!(self.shape(w.resource), Shape::Pixels { .. } | Shape::Words { .. }))
        {
            return;
        }
        let mut pass = last.clone();
        for write in &mut pass.writes {
            write.resource = self.add(self.shape(write.resource), Origin::Pass);
        }
        self.emit(pass);
    }

    /// Some rows of an image, the others as they were.
    fn band(&mut self) {
        let images: Vec<ResourceId> = self.pool.iter().copied().filter(|id| is_image(self.shape(*id)) && self.may_update(*id)).collect();
        // A state that is updated in place would have to be handed on.
        let images: Vec<ResourceId> = images.into_iter().filter(|id| self.graph.resource(*id).origin == Origin::Pass).collect();
        if images.is_empty() {
            return;
        }
        let old = self.numbers.of(&images);
        let mut reads = Vec::new();
        self.aside(&mut reads);
        let shape = self.shape(old);
        self.pass(Entry::Each, reads, vec![(shape, Access::Store, Some(old))], Grid::Elements([SIZE[0], 2, 1]));
    }

    fn points(&mut self) {
        let from = self.find(|s| is_image(s) || is_table(s)).expect("a graph begins with an image");
        let reads = vec![self.read(from, Reach::Whole)];
        let size = self.size();
        let shape = Shape::image(size, 4);
        self.pass(Entry::Points, reads, vec![(shape, Access::Store, None)], Grid::Elements([100, 1, 1]));
    }

    fn literal(&mut self) {
        let bytes: Vec<u8> = (0..16_u8).flat_map(|i| [i, self.graph.resources.len() as u8, 0, 0]).collect();
        let id = self.add(Shape::uints(16), Origin::Literal(bytes.into()));
        self.pool.push(id);
    }

    /// Fetches an image as pixels of a file of one plane or two.
    fn encode(&mut self) {
        let size = self.size();
        let image = self.image(size);
        let per = self.numbers.of(&[1, 2, 4]);
        let shape = Shape::Pixels { size, pixel: 4 / per };
        let planes = 1 + usize::from(self.numbers.one_in(4));
        let reads = vec![self.read(image, Reach::Point)];
        self.pass(Entry::Each, reads, vec![(shape, Access::Store, None); planes], Grid::Pixels(per));
        let Some(Item::Pass(pass)) = self.items.last() else { unreachable!("a pass was added") };
        let bytes = shape.bytes();
        let parts = (0_u64..).zip(&pass.writes).map(|(i, w)| (w.resource, i * bytes..(i + 1) * bytes)).collect();
        self.graph.fetches.push(Fetch { name: pass.name.clone(), parts });
    }

    /// Fetches a table, a scalar or a volume.
    fn fetch(&mut self) {
        let Some(mut id) = self.find(|s| !is_image(s)) else { return };
        if let Shape::Volume(t) = self.shape(id) {
            let len = t.size.iter().product();
            let reads = vec![self.read(id, Reach::Point)];
            self.pass(Entry::Each, reads, vec![(Shape::Words { len }, Access::Store, None)], Grid::Elements([len, 1, 1]));
            id = ResourceId(self.graph.resources.len() as u32 - 1);
        }
        self.taken.insert(id);
        let name = format!("fetch{}", self.graph.fetches.len());
        self.graph.fetches.push(Fetch { name, parts: vec![(id, 0..self.shape(id).bytes())] });
    }

    /// Keeps something for the next frame, and reads what the one before kept, when there was one.
    fn history(&mut self) {
        let Some(id) = self.find(|_| true) else { return };
        self.taken.insert(id);
        let name = format!("history{}", self.graph.kept.len());
        let delay = 1 + self.numbers.below(2);
        self.graph.kept.push(Kept { name: name.clone(), resource: id, delay });
        if !self.numbers.one_in(3) {
            let recalled = self.add(self.shape(id), Origin::History { name, delay });
            self.pool.push(recalled);
        }
    }

    fn repeat(&mut self) {
        if self.depth == 2 {
            return;
        }
        let mut inits = Vec::new();
        for _ in 0..self.numbers.of(&[1, 1, 2, 2, 3]) {
            // The same image, so that states may swap, or anything.
            let again = inits.last().copied().filter(|_| self.numbers.one_in(4));
            let images_only = !self.numbers.one_in(3);
            let init = again.or_else(|| self.find(|s| !images_only || is_image(s)));
            inits.push(init.expect("a graph begins with an image"));
        }
        let outer_items = std::mem::take(&mut self.items);
        let outer_pool = self.pool.clone();
        let outer_from = std::mem::replace(&mut self.inside_from, self.graph.resources.len() as u32);
        self.depth += 1;
        let carried: Vec<ResourceId> = inits.iter().map(|id| self.add(self.shape(*id), Origin::State)).collect();
        let results: Vec<ResourceId> = inits.iter().map(|id| self.add(self.shape(*id), Origin::State)).collect();
        self.pool.extend(&carried);
        let body_from = self.graph.resources.len() as u32;
        for _ in 0..self.numbers.below(5) {
            let kind = self.numbers.below(u32::from(KINDS_INSIDE)) as u8;
            self.choice(kind);
        }
        let mut nexts = Vec::new();
        for id in &carried {
            nexts.push(self.next(*id, &nexts, &carried, &outer_pool, body_from));
        }
        let count = if self.numbers.one_in(4) {
            self.scalar();
            let value = *self.pool.last().expect("a scalar was made");
            Count::Until { value, limit: 0.5, every: 1 + self.numbers.below(3), max: self.numbers.of(&[1, 2, 3, 4, 5]) }
        } else {
            Count::Fixed(self.numbers.of(&[0, 1, 2, 2, 3, 3, 4]))
        };
        self.depth -= 1;
        self.inside_from = outer_from;
        self.pool = outer_pool;
        self.pool.extend(&results);
        let body = std::mem::replace(&mut self.items, outer_items);
        let states = inits.iter().zip(&carried).zip(nexts.iter().zip(&results));
        let states = states.map(|((i, c), (n, r))| State { init: *i, carried: *c, next: *n, result: *r }).collect();
        let name = format!("loop{}", self.graph.nodes.len());
        self.graph.nodes.push(name.clone());
        let node = NodeLabel(self.graph.nodes.len() as u32 - 1);
        self.items.push(Item::Loop(Loop { name, node, states, body, count }));
    }

    /// What the body hands on for a state: what was made of it, itself, another state, something from outside.
    fn next(
        &mut self,
        own: ResourceId,
        nexts: &[ResourceId],
        carried: &[ResourceId],
        outside: &[ResourceId],
        body_from: u32,
    ) -> ResourceId {
        if !self.pool.contains(&own) {
            return self.updated(own);
        }
        let shape = self.shape(own);
        let alike = |maker: &Self, list: &[ResourceId]| -> Vec<ResourceId> {
            let there = list.iter().filter(|id| maker.pool.contains(id) && maker.shape(**id) == shape);
            there.copied().filter(|id| !carried.iter().any(|c| !maker.pool.contains(c) && maker.updated(*c) == *id)).collect()
        };
        let pool = self.pool.clone();
        let made: Vec<ResourceId> = alike(self, &pool).into_iter().filter(|id| id.0 >= body_from).collect();
        let found = match self.numbers.below(8) {
            0 => vec![own],
            1 | 2 => alike(self, carried),
            3 => alike(self, outside),
            _ => made,
        };
        if !found.is_empty() {
            return self.numbers.of(&found);
        }
        let in_place = is_table(shape) && !nexts.contains(&own) && self.numbers.one_in(2);
        if in_place {
            self.pass(Entry::Each, Vec::new(), vec![(shape, Access::Update, Some(own))], Grid::Elements([shape.entries(), 1, 1]));
        } else {
            let (entry, reach) = if is_image(shape) { (Entry::Point, Reach::Point) } else { (Entry::At, Reach::Whole) };
            let reads = vec![self.read(own, reach)];
            self.pass(entry, reads, vec![(shape, Access::Store, None)], Grid::Cover);
        }
        *self.pool.last().expect("a pass was added")
    }

    /// What a resource has become by updates in its place.
    fn updated(&self, id: ResourceId) -> ResourceId {
        let writes = self.items.iter().filter_map(|item| if let Item::Pass(pass) = item { Some(&pass.writes) } else { None });
        match writes.flatten().find(|w| w.in_place_of == Some(id)) {
            Some(write) => self.updated(write.resource),
            None => id,
        }
    }
}
