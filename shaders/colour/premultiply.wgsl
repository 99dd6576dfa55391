// `Premultiply`: colour times alpha.

fn apply(image: vec4f) -> vec4f {
    return vec4f(image.rgb * image.a, image.a);
}
