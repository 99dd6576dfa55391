// rgb·key/average

fn apply(image: vec4f) -> vec4f {
    return vec4f(image.rgb * (params.key / params.average), image.a);
}
