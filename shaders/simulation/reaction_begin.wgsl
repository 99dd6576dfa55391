// (U, V) of any image; a single channel is V among what is left of U.

fn apply(image: vec4f) -> vec4f {
    return select(image, vec4f(1.0 - image.x, image.x, 0.0, 1.0), SEED);
}
