// `CopyRegion` into an image; `fetch` comes from the kind of the source.

fn at(xy: vec2i) -> vec4f {
    let p = vec3i(xy, 0) - params.dst_origin;
    if all(p >= vec3i(0)) && all(p < params.extent) {
        return fetch(p);
    }
    return load_dst(xy);
}
