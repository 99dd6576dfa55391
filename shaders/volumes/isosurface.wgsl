// HALVINGS: of the last step in search of the surface; 0 takes the sample behind it.

import package::lib::ray::{cube_span, eye_ray, seen_at};

struct Hit {
    found: bool,
    depth: f32,
}

/// The distance of the i-th sample.
fn sample_at(i: i32, span: vec2f) -> f32 {
    return mix(span.x, span.y, f32(i) / f32(params.steps));
}

fn surface(origin: vec3f, direction: vec3f, span: vec2f) -> Hit {
    var i = 0;
    while i <= params.steps {
        let distance = sample_at(i, span);
        let p = origin + distance * direction;
        let here = brick(p, direction);
        if here.extreme < params.iso {
            // On to the last sample in this brick, which is below too.
            let behind = floor((distance + here.length - span.x) / (span.y - span.x) * f32(params.steps));
            i = max(i + 1, i32(behind));
            continue;
        }
        if density(p) >= params.iso {
            return Hit(true, refined(origin, direction, sample_at(max(i - 1, 0), span), distance));
        }
        i++;
    }
    return Hit(false, 0.0);
}

fn refined(origin: vec3f, direction: vec3f, before: f32, behind: f32) -> f32 {
    var outside = before;
    var inside = behind;
    for (var i = 0; i < HALVINGS; i++) {
        let middle = 0.5 * (outside + inside);
        if density(origin + middle * direction) >= params.iso {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    return inside;
}

fn each(xy: vec2i) {
    let ray = eye_ray(xy, size_out(), params.eye, params.right, params.up, params.forward);
    let span = cube_span(ray);
    var hit = Hit(false, 0.0);
    if span.x < span.y {
        hit = surface(ray.origin, ray.direction, span);
    }
    if !hit.found {
        store_out(xy, vec4f());
        store_depth(xy, vec4f());
        store_normal(xy, vec4f());
        return;
    }
    let p = ray.origin + hit.depth * ray.direction;
    let n = normal_at(p);
    store_out(xy, vec4f(vec3f(lit(p, n)), 1.0));
    store_depth(xy, vec4f(hit.depth * length(ray.direction * params.proportions)));
    store_normal(xy, vec4f(n, 1.0));
}
