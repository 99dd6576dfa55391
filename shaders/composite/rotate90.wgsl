fn at(xy: vec2i) -> vec4f {
    let last = size_image() - 1;
    switch TURNS {
        case 1: { return load_image(vec2i(xy.y, last.y - xy.x)); }
        case 2: { return load_image(last - xy); }
        default: { return load_image(vec2i(last.x - xy.y, xy.x)); }
    }
}
