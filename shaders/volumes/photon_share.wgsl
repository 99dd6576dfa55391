// Shares of the weight of all photons.

fn share_of(sum: vec2u) -> f32 {
    return (f32(sum.y) * 16.0 + f32(sum.x) / 268435456.0) / f32(load_tallies(PHOTONS));
}

fn share(at: i32) -> f32 {
    return share_of(vec2u(load_tallies(at), load_tallies(at + 1)));
}
