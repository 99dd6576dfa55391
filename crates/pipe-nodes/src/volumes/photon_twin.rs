//! Photons in double precision: the same walks as on the GPU, from the same random words, written from the formulas.

use glam::DVec3;
use pipe_graph::prelude::*;

use super::light::Emitter;
use super::medium::Extinction;
use super::phase::Phase;
use super::random::{exponential, open_unit, philox, tausworthe};

/// Everything that a photon meets.
pub(super) struct Walk<'a> {
    pub(super) medium: &'a Extinction<'a>,
    /// Voxels of the results.
    pub(super) size: [u32; 3],
    pub(super) emitter: Emitter,
    pub(super) phase: Phase,
    pub(super) albedo: f64,
    pub(super) min_energy: f64,
    /// Whether x and z have no faces.
    pub(super) periodic: bool,
    /// Length of the pieces of a marched ray; `None` where free paths are drawn by the largest σt.
    pub(super) marched: Option<f64>,
    /// Whether fluence is counted by the lengths of paths.
    pub(super) counts_paths: bool,
    pub(super) generator: Generator,
}

/// Where random words come from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Generator {
    pub(super) key: [u32; 2],
    pub(super) tausworthe: bool,
}

/// The random words of one photon.
struct Words {
    generator: Generator,
    photon: u32,
    draws: u32,
    state: [u32; 4],
}

impl Words {
    fn new(generator: Generator, photon: u32) -> Self {
        let [a, b, c, d] = philox([photon, 0, 0, 0], generator.key);
        Self { generator, photon, draws: 0, state: [a | 128, b | 128, c | 128, d] }
    }

    fn draw(&mut self) -> [u32; 4] {
        if self.generator.tausworthe {
            return std::array::from_fn(|_| {
                self.state = tausworthe(self.state);
                self.state.into_iter().fold(0, |a, b| a ^ b)
            });
        }
        self.draws += 1;
        philox([self.photon, self.draws, 0, 0], self.generator.key)
    }
}

/// What photons leave behind, in the units of the GPU's counts: weights of 2²⁸, fluence of 2²⁴.
#[derive(Debug, Clone)]
pub(super) struct Counts {
    photons: u64,
    batches: u64,
    fluence: Vec<f64>,
    deposited: Vec<f64>,
    squares: Vec<f64>,
    faces: [f64; 6],
}

const WEIGHT: f64 = 268_435_456.0;
const FLUENCE: f64 = 16_777_216.0;

/// Words before the voxels in the table of counts.
const VOXELS: usize = 20;

fn fixed_weight(w: f64) -> f64 {
    (w * WEIGHT + 0.5).floor()
}

impl Walk<'_> {
    fn voxels(&self) -> usize {
        self.size.iter().map(|n| *n as usize).product()
    }

    fn sizes(&self) -> DVec3 {
        DVec3::from_array(self.size.map(f64::from))
    }

    fn voxel(&self, p: DVec3) -> usize {
        let index: [usize; 3] =
            std::array::from_fn(|i| (p[i] * f64::from(self.size[i])).floor().clamp(0.0, f64::from(self.size[i] - 1)) as usize);
        (index[2] * self.size[1] as usize + index[1]) * self.size[0] as usize + index[0]
    }

    /// Walks photons in batches, behind those of an earlier table of counts.
    pub(super) fn run(&self, earlier: &[f64], photons: u32, batches: u32) -> Counts {
        let mut counts = Counts::read(earlier, self.voxels());
        let last = counts.photons + u64::from(photons);
        let share = u64::from(photons.div_ceil(batches));
        while counts.photons < last {
            let count = share.min(last - counts.photons);
            let mut batch = Counts::read(&[], self.voxels());
            for photon in counts.photons..counts.photons + count {
                self.photon(photon as u32, &mut batch);
            }
            counts.fold(&batch, count);
        }
        counts
    }

    fn photon(&self, index: u32, counts: &mut Counts) {
        let mut words = Words::new(self.generator, index);
        let first = words.draw();
        let [origin, mut direction] = self.emitter.emit(open_unit(first[0]), open_unit(first[1]));
        let mut place = self.entered(origin, direction);
        let mut depth = exponential(first[3]);
        let mut weight = 1.0;
        loop {
            if (0..3).any(|i| !(0.0..=1.0).contains(&place[i])) {
                let axis = longest(direction);
                counts.faces[2 * axis + usize::from(direction[axis] > 0.0)] += fixed_weight(weight);
                return;
            }
            let Some((next, sigma)) = self.fly(place, direction, weight, &mut depth, counts) else { return };
            place = next;
            let drawn = words.draw();
            depth = exponential(drawn[3]);
            let here = if self.marched.is_some() { sigma } else { self.medium.at(place) };
            let exact = self.marched.is_some() || self.medium.is_homogeneous();
            if !exact && open_unit(drawn[0]) * sigma >= here {
                continue;
            }
            if !self.counts_paths {
                counts.fluence[self.voxel(place)] += weight * self.medium.majorant / here * FLUENCE;
            }
            let roulette = ((drawn[0] & 511) << 18) | ((drawn[1] & 511) << 9) | (drawn[2] & 511);
            let left = match weight > self.min_energy {
                true => weight * self.albedo,
                false if open_unit(roulette << 5) < self.albedo => weight,
                false => 0.0,
            };
            counts.deposited[self.voxel(place)] += fixed_weight(weight) - fixed_weight(left);
            if left == 0.0 {
                return;
            }
            weight = left;
            direction = self.phase.scatter(direction, open_unit(drawn[1]), open_unit(drawn[2]));
        }
    }

    /// To the next collision, with the σt that it was found by; `None` when the photon leaves.
    fn fly(&self, from: DVec3, direction: DVec3, weight: f64, depth: &mut f64, counts: &mut Counts) -> Option<(DVec3, f64)> {
        let mut place = from;
        loop {
            let ways = to_faces(place, direction);
            let to_face = ways.min_element();
            let length = self.marched.map_or(to_face, |step| step.min(to_face).min(self.to_voxel_face(place, direction)));
            let sigma = match self.marched {
                Some(_) => self.medium.at(place + 0.5 * length * direction),
                None => self.medium.majorant,
            };
            if *depth <= sigma * length {
                let path = *depth / sigma;
                self.count_path(place, direction, path, weight, counts);
                return Some((place + path * direction, sigma));
            }
            *depth -= sigma * length;
            self.count_path(place, direction, length, weight, counts);
            place += length * direction;
            if length < to_face {
                continue;
            }
            for axis in 0..3 {
                if ways[axis] > to_face {
                    continue;
                }
                let up = direction[axis] > 0.0;
                place[axis] = f64::from(u8::from(up));
                if self.periodic && axis != 1 {
                    place[axis] = 1.0 - place[axis];
                } else {
                    counts.faces[2 * axis + usize::from(up)] += fixed_weight(weight);
                    return None;
                }
            }
        }
    }

    /// The way to the next face of a voxel, where pieces of a marched ray end if their lengths are counted.
    fn to_voxel_face(&self, place: DVec3, direction: DVec3) -> f64 {
        if !self.counts_paths {
            return f64::INFINITY;
        }
        let way = |axis: usize| {
            let (size, d) = (f64::from(self.size[axis]), direction[axis]);
            // A place within rounding of a face is on it.
            let next = (place[axis] * size + 1e-9).floor() + 1.0;
            let last = (place[axis] * size - 1e-9).ceil() - 1.0;
            let face = if d > 0.0 { next } else { last };
            if d == 0.0 { f64::INFINITY } else { (face / size - place[axis]) / d }
        };
        way(0).min(way(1)).min(way(2))
    }

    /// Deals a path out to the voxels that it passes.
    fn count_path(&self, from: DVec3, direction: DVec3, length: f64, weight: f64, counts: &mut Counts) {
        if !self.counts_paths {
            return;
        }
        let size = self.sizes();
        let mut cuts = vec![0.0, length];
        for axis in 0..3 {
            for face in 1..self.size[axis] {
                let way = (f64::from(face) / size[axis] - from[axis]) / direction[axis];
                if way > 0.0 && way < length {
                    cuts.push(way);
                }
            }
        }
        cuts.sort_unstable_by(f64::total_cmp);
        for pair in cuts.windows(2) {
            let middle = from + 0.5 * (pair[0] + pair[1]) * direction;
            counts.fluence[self.voxel(middle)] += weight * (pair[1] - pair[0]) * size.max_element() * FLUENCE;
        }
    }

    /// Where a ray from outside enters the unit cube; where it never does, a place outside.
    fn entered(&self, from: DVec3, direction: DVec3) -> DVec3 {
        let mut met = from;
        let mut farthest = 0.0;
        for axis in 0..3 {
            let up = direction[axis] > 0.0;
            let outside = if up { from[axis] < 0.0 } else { from[axis] > 1.0 };
            if (self.periodic && axis != 1) || !outside || direction[axis] == 0.0 {
                continue;
            }
            let face = f64::from(u8::from(!up));
            let way = (face - from[axis]) / direction[axis];
            if way > farthest {
                farthest = way;
                met = from + way * direction;
                met[axis] = face;
            }
        }
        if self.periodic {
            met.x -= met.x.floor();
            met.z -= met.z.floor();
        }
        met
    }
}

/// Ways along a direction to the faces of the unit cube that lie ahead.
fn to_faces(place: DVec3, direction: DVec3) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|i| match direction[i] {
        0.0 => f64::INFINITY,
        d if d > 0.0 => (1.0 - place[i]) / d,
        d => -place[i] / d,
    }))
}

fn longest(v: DVec3) -> usize {
    let a = v.abs();
    if a.x >= a.y.max(a.z) {
        0
    } else if a.z > a.y {
        2
    } else {
        1
    }
}

impl Counts {
    /// From a table as `tallies` has it; nothing from an empty one.
    fn read(table: &[f64], voxels: usize) -> Self {
        let word = |i: usize| table.get(i).copied().unwrap_or_default();
        let wide = |i: usize| word(i + 1) * 4_294_967_296.0 + word(i);
        let square = |v: usize| f64::from(f32::from_bits(word(VOXELS + 4 * voxels + v) as u32));
        Self {
            photons: word(0) as u64,
            batches: word(1) as u64,
            fluence: (0..voxels).map(|v| wide(VOXELS + 4 * v)).collect(),
            deposited: (0..voxels).map(|v| wide(VOXELS + 4 * v + 2)).collect(),
            squares: (0..voxels).map(square).collect(),
            faces: std::array::from_fn(|i| wide(8 + 2 * i)),
        }
    }

    fn fold(&mut self, batch: &Self, count: u64) {
        let (n, before) = (count as f64, self.photons as f64);
        for v in 0..self.fluence.len() {
            if before > 0.0 {
                let apart = batch.fluence[v] / n - self.fluence[v] / before;
                self.squares[v] += apart * apart * n * before / (n + before);
            }
            self.fluence[v] += batch.fluence[v];
            self.deposited[v] += batch.deposited[v];
        }
        for face in 0..6 {
            self.faces[face] += batch.faces[face];
        }
        self.photons += count;
        self.batches += 1;
    }

    fn table(&self) -> Vec<f64> {
        let wide = |v: f64| [v.round() % 4_294_967_296.0, (v.round() / 4_294_967_296.0).floor()];
        let mut table = vec![self.photons as f64, self.batches as f64, self.photons as f64];
        table.resize(8, 0.0);
        table.extend(self.faces.iter().flat_map(|f| wide(*f)));
        table.extend(self.fluence.iter().zip(&self.deposited).flat_map(|(f, d)| [wide(*f), wide(*d)].concat()));
        table.extend(self.squares.iter().map(|s| f64::from((*s as f32).to_bits())));
        table
    }

    /// The outputs of the node.
    pub(super) fn tensors(&self, walk: &Walk<'_>) -> Vec<Tensor> {
        let n = self.photons as f64;
        let unit = if walk.counts_paths { walk.sizes().max_element() } else { walk.medium.majorant };
        let scale = if unit > 0.0 { walk.voxels() as f64 / FLUENCE / unit } else { 0.0 };
        let volume = |voxels: Vec<f64>| {
            Tensor::Volume(Block { size: walk.size, channels: 1, voxels: voxels.into_iter().map(|v| [v, v, v, 1.0]).collect() })
        };
        let fluence: Vec<f64> = self.fluence.iter().map(|f| f / n * scale).collect();
        let error = match self.batches {
            0 | 1 => fluence.clone(),
            b => self.squares.iter().map(|s| (s / (b - 1) as f64 / n).sqrt() * scale).collect(),
        };
        let faces: Vec<f64> = self.faces.iter().map(|f| f / WEIGHT / n).collect();
        vec![
            volume(fluence),
            volume(self.deposited.iter().map(|d| d / WEIGHT / n).collect()),
            Tensor::Scalar(vec![self.deposited.iter().sum::<f64>() / WEIGHT / n]),
            Tensor::Scalar(vec![faces.iter().sum()]),
            Tensor::Table(faces),
            Tensor::Scalar(vec![0.0]),
            volume(error),
            Tensor::Table(self.table()),
        ]
    }
}
