// Light that is scattered towards the eye, from the fluence at every point of the ray: L = ∫ T·albedo·σt·Φ/4π dt.

import package::lib::attenuation::stopped;
import package::lib::ray::{cube_span, eye_ray};

fn at(xy: vec2i) -> vec4f {
    let ray = eye_ray(xy, size_out(), params.eye, params.right, params.up, params.forward);
    let span = cube_span(ray);
    if span.x >= span.y {
        return vec4f();
    }
    let piece = (span.y - span.x) / f32(STEPS);
    var radiance = 0.0;
    var depth = 0.0;
    for (var i = 0; i < STEPS; i++) {
        let p = ray.origin + (span.x + (f32(i) + 0.5) * piece) * ray.direction;
        let sigma = sigma_t(p);
        radiance += exp(-depth) * stopped(sigma * piece) * params.albedo * 0.0795774715 * sample_fluence(p).r;
        depth += sigma * piece;
    }
    return vec4f(vec3f(radiance), stopped(depth));
}
