// Light that is scattered once on its way to the eye: PIECES of the STEPS pieces of the ray through a pixel. The state is
// (radiance, optical depth, pieces) so far. UNIFORM: σt is the same everywhere.

import package::lib::attenuation::stopped;
import package::lib::phase::phase_density;
import package::lib::ray::{Ray, cube_span, eye_ray};

/// ∫σt over the way from p through the cube.
fn optical_depth(p: vec3f, direction: vec3f, length: f32) -> f32 {
    if UNIFORM {
        return sigma_t(p) * length;
    }
    var sum = 0.0;
    for (var i = 0; i < STEPS; i++) {
        sum += sigma_t(p + (f32(i) + 0.5) / f32(STEPS) * length * direction);
    }
    return sum * length / f32(STEPS);
}

/// Radiance that is scattered at p towards the eye, per unit of σt.
fn scattered(p: vec3f, direction: vec3f) -> f32 {
    let light = arrival(p);
    if light.irradiance == 0.0 {
        return 0.0;
    }
    let way = min(light.distance, cube_span(Ray(p, light.towards)).y);
    let arrives = light.irradiance * exp(-optical_depth(p, light.towards, way));
    return params.albedo * arrives * phase_density(PHASE, params.g, dot(light.towards, direction));
}

fn at(xy: vec2i) -> vec4f {
    let state = load_state(xy);
    let ray = eye_ray(xy, size_state(), params.eye, params.right, params.up, params.forward);
    let span = cube_span(ray);
    if span.x >= span.y {
        return vec4f();
    }
    let piece = (span.y - span.x) / f32(STEPS);
    let first = i32(state.z);
    var radiance = state.x;
    var depth = state.y;
    for (var i = first; i < min(first + PIECES, STEPS); i++) {
        let p = ray.origin + (span.x + (f32(i) + 0.5) * piece) * ray.direction;
        let sigma = sigma_t(p);
        if sigma > 0.0 {
            radiance += exp(-depth) * stopped(sigma * piece) * scattered(p, ray.direction);
            depth += sigma * piece;
        }
    }
    return vec4f(radiance, depth, f32(first + PIECES), 0.0);
}
