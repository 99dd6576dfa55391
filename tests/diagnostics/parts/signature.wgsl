fn at(uv: vec2f) -> vec4f {
    return sample_image(uv);
}
