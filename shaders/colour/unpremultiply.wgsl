// `Unpremultiply`: colour over alpha.

fn apply(image: vec4f) -> vec4f {
    let a = select(image.a, 1.0, image.a == 0.0);
    return vec4f(image.rgb / a, image.a);
}
