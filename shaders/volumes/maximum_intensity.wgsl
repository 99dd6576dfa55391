// GREY: the volume has one channel, and bricks that hold nothing greater than what was found are leapt over.

import package::lib::ray::{cube_span, eye_ray};

fn at(xy: vec2i) -> vec4f {
    let ray = eye_ray(xy, size_out(), params.eye, params.right, params.up, params.forward);
    let span = cube_span(ray);
    if span.x >= span.y {
        return vec4f();
    }
    let step = (span.y - span.x) / f32(params.steps);
    var most = vec4f(-3.4e38);
    var i = 0;
    while i < params.steps {
        let p = ray.origin + (span.x + (f32(i) + 0.5) * step) * ray.direction;
        if GREY {
            let here = brick(p, ray.direction);
            if here.extreme <= most.r {
                i += max(1, i32(here.length / step));
                continue;
            }
        }
        let v = sample_volume(p);
        // What is not a number is not greater.
        most = select(most, v, most < v);
        i++;
    }
    return most;
}
