// `CopyRegion` into a volume; `fetch` comes from the kind of the source.

fn at(xyz: vec3i) -> vec4f {
    let p = xyz - params.dst_origin;
    if all(p >= vec3i(0)) && all(p < params.extent) {
        return fetch(p);
    }
    return load_dst(xyz);
}
