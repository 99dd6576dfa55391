fn at(xy: vec2i) -> vec4f {
    let from = xy - params.origin;
    if COLORED && (any(from < vec2i(0)) || any(from >= size_image())) {
        return params.color;
    }
    return load_image(from);
}
