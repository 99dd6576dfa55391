import package::lib::ray::{cube_span, eye_ray};

fn at(xy: vec2i) -> vec4f {
    let ray = eye_ray(xy, size_out(), params.eye, params.right, params.up, params.forward);
    let span = cube_span(ray);
    if span.x >= span.y {
        return vec4f();
    }
    var most = vec4f(-3.4e38);
    for (var i = 0; i < params.steps; i++) {
        let distance = mix(span.x, span.y, (f32(i) + 0.5) / f32(params.steps));
        let v = sample_volume(ray.origin + distance * ray.direction);
        // What is not a number is not greater.
        most = select(most, v, v > most);
    }
    return most;
}
