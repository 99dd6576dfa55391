// rgb·key/average

fn apply(image: vec4f) -> vec4f {
    // An average of 0 must not make black NaN.
    return vec4f(image.rgb * (params.key / max(params.average, 1e-30)), image.a);
}
