// (u, v) of any image; a single channel is u, at rest.

fn apply(image: vec4f) -> vec4f {
    return vec4f(image.x, select(image.y, 0.0, AT_REST), 0.0, 1.0);
}
