// Light that paths from the eye find: at every collision a shadow ray asks the light, and the path goes on where the phase
// function sends it. One thread walks PATHS paths of one pixel, one after another, then takes the next pixel; a walk is
// kept in `lanes` between dispatches.
//
// Free paths are drawn by the largest σt, and collisions that are none are rejected (E. Woodcock et al. 1965); on a shadow
// ray each lowers what arrives (ratio tracking: J. Novák et al. 2014). In a homogeneous medium (UNIFORM) both are exact
// without. In `score` stands what `gather.wgsl` names. Random numbers are keyed by seed, pixel and path and counted by draw.

import package::lib::phase::{phase_density, scatter};
import package::lib::random::{exponential, open_unit, philox};
import package::lib::ray::{Ray, cube_span, eye_ray};

struct Walk {
    place: vec3f,
    direction: vec3f,
    throughput: f32,
    /// Radiance found so far in this pixel.
    found: f32,
    /// What the shadow ray will bring if nothing more is in its way, and the way that it has left; 0 without one.
    shade: f32,
    shade_left: f32,
    /// 1 + the number of the pixel; 0: there is none.
    pixel: u32,
    path: u32,
    bounces: u32,
    draws: u32,
    /// Paths that met the medium.
    hits: u32,
}

fn load_word(lane: i32, word: i32) -> u32 {
    return load_lanes(word * LANES + lane);
}

fn load_float(lane: i32, word: i32) -> f32 {
    return bitcast<f32>(load_word(lane, word));
}

fn load_walk(lane: i32) -> Walk {
    return Walk(
        vec3f(load_float(lane, 0), load_float(lane, 1), load_float(lane, 2)),
        vec3f(load_float(lane, 3), load_float(lane, 4), load_float(lane, 5)),
        load_float(lane, 6), load_float(lane, 7), load_float(lane, 8), load_float(lane, 9),
        load_word(lane, 10), load_word(lane, 11), load_word(lane, 12), load_word(lane, 13), load_word(lane, 14),
    );
}

fn store_word(lane: i32, word: i32, v: u32) {
    store_lanes(word * LANES + lane, v);
}

fn store_float(lane: i32, word: i32, v: f32) {
    store_word(lane, word, bitcast<u32>(v));
}

fn store_walk(lane: i32, walk: Walk) {
    for (var i = 0; i < 3; i++) {
        store_float(lane, i, walk.place[i]);
        store_float(lane, 3 + i, walk.direction[i]);
    }
    store_float(lane, 6, walk.throughput);
    store_float(lane, 7, walk.found);
    store_float(lane, 8, walk.shade);
    store_float(lane, 9, walk.shade_left);
    store_word(lane, 10, walk.pixel);
    store_word(lane, 11, walk.path);
    store_word(lane, 12, walk.bounces);
    store_word(lane, 13, walk.draws);
    store_word(lane, 14, walk.hits);
}

/// Begins the next path of the pixel.
fn begin_path(walk: ptr<function, Walk>) {
    let width = params.size.x;
    let pixel = i32((*walk).pixel - 1u);
    let ray = eye_ray(vec2i(pixel % width, pixel / width), params.size, params.eye, params.right, params.up, params.forward);
    let span = cube_span(ray);
    (*walk).place = ray.origin + span.x * ray.direction;
    (*walk).direction = ray.direction;
    (*walk).throughput = 1.0;
    (*walk).bounces = 0u;
    (*walk).draws = 0u;
    if span.x >= span.y {
        end_pixel(walk);
    }
}

fn begin_pixel(number: u32) -> Walk {
    var walk: Walk;
    walk.pixel = number + 1u;
    begin_path(&walk);
    return walk;
}

fn end_pixel(walk: ptr<function, Walk>) {
    let pixel = i32((*walk).pixel - 1u);
    store_pixels(2 * pixel, (*walk).found / f32(PATHS));
    store_pixels(2 * pixel + 1, f32((*walk).hits) / f32(PATHS));
    (*walk).pixel = 0u;
}

fn end_path(walk: ptr<function, Walk>) {
    (*walk).path += 1u;
    if (*walk).path == u32(PATHS) {
        end_pixel(walk);
    } else {
        begin_path(walk);
    }
}

fn draw(walk: ptr<function, Walk>) -> vec4u {
    (*walk).draws += 1u;
    return philox(vec4u((*walk).pixel, (*walk).path, (*walk).draws, 0u), vec2u(params.seed_low, params.seed_high));
}

/// Takes a shadow ray to its next possible collision, or to its end.
fn advance_shade(walk: ptr<function, Walk>) {
    let free = exponential(draw(walk).w) / params.majorant;
    let light = arrival((*walk).place);
    let left = (*walk).shade_left - free;
    if left <= 0.0 {
        (*walk).found += (*walk).shade;
        (*walk).shade_left = 0.0;
        return;
    }
    let whole = way_to_light((*walk).place, light);
    (*walk).shade *= 1.0 - sigma_t((*walk).place + (whole - left) * light.towards) / params.majorant;
    (*walk).shade_left = select(0.0, left, (*walk).shade > 0.0);
}

/// How far through the cube light travels to p.
fn way_to_light(p: vec3f, light: Arrival) -> f32 {
    return min(light.distance, cube_span(Ray(p, light.towards)).y);
}

/// Takes a path to its next possible collision, or to its end.
fn advance_path(walk: ptr<function, Walk>) {
    let words = draw(walk);
    let free = exponential(words.w) / params.majorant;
    let direction = (*walk).direction;
    if !(free < cube_span(Ray((*walk).place, direction)).y) {
        end_path(walk);
        return;
    }
    let place = clamp((*walk).place + free * direction, vec3f(0.0), vec3f(1.0));
    (*walk).place = place;
    if !UNIFORM && open_unit(words.x) * params.majorant >= sigma_t(place) {
        return;
    }
    if (*walk).bounces == 0u {
        (*walk).hits += 1u;
    }
    (*walk).bounces += 1u;
    (*walk).throughput *= params.albedo;
    let light = arrival(place);
    let shade = (*walk).throughput * light.irradiance * phase_density(PHASE, params.g, dot(light.towards, direction));
    let way = way_to_light(place, light);
    if UNIFORM {
        (*walk).found += shade * exp(-params.majorant * way);
    } else if shade > 0.0 {
        (*walk).shade = shade;
        (*walk).shade_left = way;
    }
    (*walk).direction = scatter(PHASE, params.g, direction, open_unit(words.y), open_unit(words.z));
}

fn each(lane: i32) {
    var walk = load_walk(lane);
    let pixels = load_score(LIMIT);
    var ended = 0u;
    for (var step = 0; step < STEPS; step++) {
        if walk.pixel == 0u {
            if load_score(ISSUED) >= pixels {
                break;
            }
            let ticket = add_score(ISSUED, 1u);
            if ticket >= pixels {
                break;
            }
            walk = begin_pixel(ticket);
        } else if walk.shade_left > 0.0 {
            advance_shade(&walk);
        } else if walk.bounces >= u32(MAX_BOUNCES) {
            end_path(&walk);
        } else {
            advance_path(&walk);
        }
        if walk.pixel == 0u {
            ended += 1u;
        }
    }
    store_walk(lane, walk);
    if ended > 0u {
        add_score(ENDED, ended);
    }
}
