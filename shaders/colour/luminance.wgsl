// The weighted sum of the channels.

fn apply(image: vec4f) -> vec4f {
    return vec4f(dot(params.weights, image.rgb));
}
