// The border policy of the port repeats or mirrors.

fn at(xy: vec2i) -> vec4f {
    return load_image(xy);
}
