// rgb·2^ev

fn apply(image: vec4f) -> vec4f {
    return vec4f(image.rgb * exp2(params.ev), image.a);
}
