fn apply(a: vec4f, b: vec4f) -> vec4f {
    return vec4f(operation(a, b).rgb, a.a);
}
