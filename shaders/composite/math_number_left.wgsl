fn apply(b: vec4f) -> vec4f {
    return vec4f(operation(vec4f(params.number), b).rgb, b.a);
}
