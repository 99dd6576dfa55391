// Pixels that are not done.

fn at(i: i32) -> vec4f {
    return vec4f(f32(params.pixels - load_score(1)));
}
