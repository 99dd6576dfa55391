// A rectangle of an image.

fn at(xy: vec2i) -> vec4f {
    return load_image(xy + params.origin);
}
