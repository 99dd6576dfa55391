// Pixels that may be taken and are not done.

fn at(i: i32) -> vec4f {
    return vec4f(f32(load_score(LIMIT) - load_score(ENDED)));
}
