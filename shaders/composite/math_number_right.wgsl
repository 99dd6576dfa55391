fn apply(a: vec4f) -> vec4f {
    return vec4f(operation(a, vec4f(params.number)).rgb, a.a);
}
