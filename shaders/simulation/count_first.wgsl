fn at(i: i32) -> vec4f {
    return vec4f(1.0);
}
