fn at(xy: vec2i) -> vec4f {
    let place = xy - params.origin;
    if COLORED && (any(place < vec2i(0)) || any(place >= size_image())) {
        return params.color;
    }
    return load_image(place);
}
