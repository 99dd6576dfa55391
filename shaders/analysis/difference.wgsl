// |a − b| of every colour channel, opaque.

fn apply(a: vec4f, b: vec4f) -> vec4f {
    return vec4f(abs(a.rgb - b.rgb), 1.0);
}
