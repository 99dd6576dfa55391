// 1 − c

fn apply(image: vec4f) -> vec4f {
    return vec4f(1.0 - image.rgb, image.a);
}
