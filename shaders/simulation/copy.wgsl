fn apply(image: vec4f) -> vec4f {
    return image;
}
