// `transfer(p)`, added behind this file, is the colour and the opacity of a reference step at a point.

import package::lib::ray::{cube_span, eye_ray};

const REFERENCE_STEP: f32 = 0.0067658234670659265;
/// What passes here is not worth another sample: both orders of compositing agree within 1e-4.
const TOO_LITTLE: f32 = 9e-5;

/// Colour times opacity, and opacity, of the i-th step of a ray.
fn step_of(origin: vec3f, direction: vec3f, span: vec2f, i: i32) -> vec4f {
    let near = span.x + f32(i) * params.step_length;
    let length = min(params.step_length, span.y - near);
    let sample = transfer(origin + (near + 0.5 * length) * direction);
    let alpha = 1.0 - pow(1.0 - sample.a, length / REFERENCE_STEP);
    return vec4f(sample.rgb * alpha, alpha);
}

fn at(xy: vec2i) -> vec4f {
    let ray = eye_ray(xy, size_out(), params.eye, params.right, params.up, params.forward);
    let span = cube_span(ray);
    var light = vec4f();
    let steps = i32(ceil((span.y - span.x) / params.step_length));
    if BACK_TO_FRONT {
        for (var i = steps - 1; i >= 0; i--) {
            let over = step_of(ray.origin, ray.direction, span, i);
            light = over + (1.0 - over.a) * light;
        }
        return light;
    }
    for (var i = 0; i < steps; i++) {
        light += (1.0 - light.a) * step_of(ray.origin, ray.direction, span, i);
        if 1.0 - light.a < TOO_LITTLE {
            break;
        }
    }
    return light;
}
