// Photons walk through the medium for STEPS steps: one thread a photon, and the next photon when one has ended. A photon
// is kept in `lanes` between dispatches, so no invocation loops for long, however long a photon lives.
//
// Each step goes to the next event: a collision, a face of the cube, and, where they matter, a face of the voxel (TRACK:
// what a photon travels in a voxel is counted) or the end of a piece of the ray (MARCH: σt is taken at its middle).
// Otherwise the free path is drawn by the largest σt, which is exact in a homogeneous medium and, as DELTA rejects
// collisions that are none, in any other (E. Woodcock et al. 1965). Distances are lengths in the unit cube, places are in
// voxels, so that faces of voxels are whole numbers.
//
// Random numbers are words of a generator keyed by seed and photon and counted by draw: no result depends on which thread
// walks a photon or when. Sums are integers: no result depends on their order. In `score` stand what `photon.wgsl` names;
// a weight of 1 is 2²⁸ there, and weights are rounded so that what a photon leaves behind adds up to 1 exactly.

import package::lib::phase::scatter;
import package::lib::random::{exponential, open_unit, philox, tausworthe};
import package::lib::sine::sin_pi;

struct Photon {
    place: vec3f,
    direction: vec3f,
    /// 0: there is none.
    weight: f32,
    /// Optical depth left until the next collision.
    depth: f32,
    index: u32,
    draws: u32,
    steps: u32,
    /// Of the Tausworthe generator.
    random: vec4u,
}

/// More steps than any photon should take: one that goes round for ever is given up.
const MOST_STEPS = 16777216u;

/// No face is that far away.
const FAR = 1e30;

fn load_word(lane: i32, word: i32) -> u32 {
    return load_lanes(word * LANES + lane);
}

fn load_vector(lane: i32, word: i32) -> vec3f {
    return bitcast<vec3f>(vec3u(load_word(lane, word), load_word(lane, word + 1), load_word(lane, word + 2)));
}

fn load_photon(lane: i32) -> Photon {
    var photon: Photon;
    photon.place = load_vector(lane, 0);
    photon.direction = load_vector(lane, 3);
    photon.weight = bitcast<f32>(load_word(lane, 6));
    photon.depth = bitcast<f32>(load_word(lane, 7));
    photon.index = load_word(lane, 8);
    photon.draws = load_word(lane, 9);
    photon.steps = load_word(lane, 10);
    if TAUSWORTHE {
        photon.random = vec4u(load_word(lane, 11), load_word(lane, 12), load_word(lane, 13), load_word(lane, 14));
    }
    return photon;
}

fn store_word(lane: i32, word: i32, v: u32) {
    store_lanes(word * LANES + lane, v);
}

fn store_vector(lane: i32, word: i32, v: vec3f) {
    for (var i = 0; i < 3; i++) {
        store_word(lane, word + i, bitcast<u32>(v[i]));
    }
}

fn store_photon(lane: i32, photon: Photon) {
    store_vector(lane, 0, photon.place);
    store_vector(lane, 3, photon.direction);
    store_word(lane, 6, bitcast<u32>(photon.weight));
    store_word(lane, 7, bitcast<u32>(photon.depth));
    store_word(lane, 8, photon.index);
    store_word(lane, 9, photon.draws);
    store_word(lane, 10, photon.steps);
    if TAUSWORTHE {
        for (var i = 0; i < 4; i++) {
            store_word(lane, 11 + i, photon.random[i]);
        }
    }
}

/// Adds to an integer of two words.
fn add_wide(at: i32, low: u32, high: u32) {
    let before = add_score(at, low);
    let carry = high + select(0u, 1u, before + low < before);
    if carry > 0u {
        let above = add_score(at + 1, carry);
        if above + carry < above {
            add_score(OVERFLOWS, 1u);
        }
    }
}

fn fixed_weight(w: f32) -> u32 {
    return u32(w * 268435456.0 + 0.5);
}

/// The set of voxels that this thread counts in.
var<private> bank: i32;

/// The entry of the voxel that holds a place.
fn voxel_entry(place: vec3f) -> i32 {
    let size = params.resolution;
    let v = clamp(vec3i(floor(place)), vec3i(0), size - 1);
    return VOXELS + 4 * (((bank * size.z + v.z) * size.y + v.y) * size.x + v.x);
}

/// Counts fluence, in units of 2⁻²⁴.
fn add_fluence(place: vec3f, amount: f32) {
    let v = amount * 16777216.0;
    let high = floor(v / 4294967296.0);
    add_wide(voxel_entry(place), u32(v - high * 4294967296.0 + 0.5), u32(high));
}

fn seed() -> vec2u {
    return vec2u(params.seed_low, params.seed_high);
}

/// Four random words.
fn draw(photon: ptr<function, Photon>) -> vec4u {
    if !TAUSWORTHE {
        (*photon).draws += 1u;
        return philox(vec4u((*photon).index, (*photon).draws, 0u, 0u), seed());
    }
    var words: vec4u;
    for (var i = 0; i < 4; i++) {
        let state = tausworthe((*photon).random);
        words[i] = state.x ^ state.y ^ state.z ^ state.w;
        (*photon).random = state;
    }
    return words;
}

/// A photon on its way into the cube, at its beginning.
fn launch(index: u32) -> Photon {
    var photon: Photon;
    photon.index = index;
    photon.weight = 1.0;
    if TAUSWORTHE {
        photon.random = philox(vec4u(index, 0u, 0u, 0u), seed()) | vec4u(128u, 128u, 128u, 0u);
    }
    let words = draw(&photon);
    let u = vec2f(open_unit(words.x), open_unit(words.y));
    photon.direction = emitted_direction(u);
    photon.place = entered(emitted_place(u), photon.direction) * vec3f(params.resolution);
    photon.depth = exponential(words.w);
    return photon;
}

/// Where a ray from outside enters the unit cube; where it never does, a place outside.
fn entered(place: vec3f, direction: vec3f) -> vec3f {
    // Where x and z are periodic only y has an outside.
    let open = vec3<bool>(!PERIODIC, true, !PERIODIC);
    let down = direction < vec3f(0.0);
    let below = place < vec3f(0.0);
    let above = place > vec3f(1.0);
    let outside = select(below, above, down) & open & (direction != vec3f(0.0));
    let face = select(vec3f(0.0), vec3f(1.0), down);
    let ways = select(vec3f(0.0), (face - place) / direction, outside);
    let way = max(ways.x, max(ways.y, ways.z));
    // To the last bit on the face through which it comes.
    var p = select(place + way * direction, face, outside & (ways == vec3f(way)));
    if PERIODIC {
        p = vec3f(fract(p.x), p.y, fract(p.z));
    }
    return p;
}

/// Counts what leaves through a face.
fn escape(axis: i32, upwards: bool, weight: f32) {
    add_wide(FACES + 4 * axis + select(0, 2, upwards), fixed_weight(weight), 0u);
}

/// The axis along which a vector is longest.
fn longest(v: vec3f) -> i32 {
    let a = abs(v);
    return select(select(1, 2, a.z > a.y), 0, a.x >= max(a.y, a.z));
}

/// Takes a photon to its next event; its weight is 0 when it has ended.
fn advance(photon: ptr<function, Photon>) {
    let size = vec3f(params.resolution);
    let place = (*photon).place;
    let direction = (*photon).direction;
    let weight = (*photon).weight;
    let pace = direction * size;
    let forward = pace > vec3f(0.0);

    if any(place < vec3f(0.0)) || any(place > size) {
        let axis = longest(direction);
        escape(axis, direction[axis] > 0.0, weight);
        (*photon).weight = 0.0;
        return;
    }
    var face = select(vec3f(0.0), size, forward);
    let wall = face;
    if TRACK {
        face = clamp(select(ceil(place) - 1.0, floor(place) + 1.0, forward), vec3f(0.0), size);
    }
    let ways = select(vec3f(FAR), (face - place) / pace, pace != vec3f(0.0));
    let to_face = min(ways.x, min(ways.y, ways.z));
    var path = to_face;
    var sigma = params.majorant;
    if MARCH {
        path = min(path, params.step);
        sigma = sigma_t((place + 0.5 * path * pace) / size);
    }
    let collides = (*photon).depth <= sigma * path;
    if collides {
        path = (*photon).depth / sigma;
    }
    var next = clamp(place + path * pace, vec3f(0.0), size);
    if TRACK {
        add_fluence(place + 0.5 * path * pace, weight * path * max(size.x, max(size.y, size.z)));
    }
    (*photon).steps += 1u;
    if collides {
        (*photon).place = next;
        collide(photon, sigma);
        return;
    }
    (*photon).depth -= sigma * path;
    let met = (ways <= vec3f(path)) & vec3<bool>(path == to_face);
    next = select(next, face, met);
    let leaves = met & (face == wall);
    if PERIODIC {
        next = select(next, size - wall, leaves & vec3<bool>(true, false, true));
        if leaves.y {
            escape(1, forward.y, weight);
            (*photon).weight = 0.0;
        }
    } else if any(leaves) {
        let axis = select(select(2, 1, leaves.y), 0, leaves.x);
        escape(axis, forward[axis], weight);
        (*photon).weight = 0.0;
    }
    (*photon).place = next;
}

/// Absorbs and scatters a photon where the free path ends.
fn collide(photon: ptr<function, Photon>, path_sigma: f32) {
    let place = (*photon).place;
    let weight = (*photon).weight;
    let words = draw(photon);
    (*photon).depth = exponential(words.w);
    var sigma = path_sigma;
    if DELTA {
        sigma = sigma_t(place / vec3f(params.resolution));
        if open_unit(words.x) * path_sigma >= sigma {
            return;
        }
    }
    if !TRACK {
        add_fluence(place, weight * min(params.majorant / sigma, 33554432.0));
    }
    // While it is heavy a photon leaves a share of its weight. Then it is absorbed as a whole or not at all: roulette
    // that changes no mean, and no sum.
    var left = weight * params.albedo;
    if weight <= params.min_energy {
        let roulette = ((words.x & 511u) << 18u) | ((words.y & 511u) << 9u) | (words.z & 511u);
        left = select(0.0, weight, open_unit(roulette << 5u) < params.albedo);
    }
    let absorbed = fixed_weight(weight) - fixed_weight(left);
    if absorbed > 0u {
        add_wide(voxel_entry(place) + 2, absorbed, 0u);
    }
    (*photon).weight = left;
    (*photon).direction = scatter(PHASE, params.g, (*photon).direction, open_unit(words.y), open_unit(words.z));
}

fn each(lane: i32) {
    bank = lane % BANKS;
    var photon = load_photon(lane);
    var ended = 0u;
    let batch = load_score(COUNT);
    for (var step = 0; step < STEPS; step++) {
        if photon.weight <= 0.0 {
            if load_score(ISSUED) >= batch {
                break;
            }
            let ticket = add_score(ISSUED, 1u);
            if ticket >= batch {
                break;
            }
            photon = launch(load_score(FIRST) + ticket);
        }
        advance(&photon);
        if photon.weight > 0.0 && photon.steps >= MOST_STEPS {
            add_wide(ALIVE, fixed_weight(photon.weight), 0u);
            photon.weight = 0.0;
        }
        if photon.weight <= 0.0 {
            ended += 1u;
        }
    }
    store_photon(lane, photon);
    if ended > 0u {
        add_score(ENDED, ended);
    }
}
