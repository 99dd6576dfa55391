// Photons of the batch that have not ended.

fn at(i: i32) -> vec4f {
    return vec4f(f32(load_score(COUNT) - load_score(ENDED)));
}
