fn fetch(p: vec3i) -> vec4f {
    return load_src((params.src_origin + p).xy);
}
