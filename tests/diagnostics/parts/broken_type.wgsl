// Twice as bright.
fn apply(image: vec4f) -> vec4f {
    return image.rgb * 2.0;
}
