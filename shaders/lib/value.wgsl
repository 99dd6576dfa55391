// What is left of a value that is stored in fewer channels and loaded again.

/// One channel is grey.
fn grey(v: vec4f) -> vec4f {
    return vec4f(v.r, v.r, v.r, 1.0);
}

/// Two channels are a pair of fields.
fn pair(v: vec4f) -> vec4f {
    return vec4f(v.r, v.g, 0.0, 1.0);
}
