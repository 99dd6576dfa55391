fn apply(image: vec4f) -> vec4f {
    return vec4f(image.rgb * params.gain + f32(params.shift), image.a);
}
