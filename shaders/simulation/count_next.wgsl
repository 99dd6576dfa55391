fn at(i: i32) -> vec4f {
    return load_before() + 1.0;
}
