// What is brighter than the threshold.

fn apply(image: vec4f) -> vec4f {
    return vec4f(max(image.rgb - params.threshold, vec3f(0.0)), image.a);
}
