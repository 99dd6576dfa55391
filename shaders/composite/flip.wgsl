fn at(xy: vec2i) -> vec4f {
    return load_image(select(xy, size_image() - 1 - xy, vec2<bool>(X, Y)));
}
