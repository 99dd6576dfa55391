// Which pixel a coordinate falls on, without losing the fraction of far pixels: coordinates are pairs (see `wide`).

/// A whole number and what is left, 0 ≤ fraction < 1.
struct Texel {
    index: i32,
    fraction: f32,
}

/// ⌊p⌋ and the rest of a pair. Far beyond any image the index stays at ±10^9.
fn texel(p: vec2f) -> Texel {
    if !(abs(p.x) < 1e9) {
        return Texel(select(-1000000000, 1000000000, p.x > 0.0), 0.0);
    }
    let whole = floor(p.x);
    // The minimum keeps compilers from adding the parts of the pair first.
    let rest = min(p.x - whole, 1.0) + p.y;
    if rest < 0.0 {
        // A rest that rounds up to 1 is the pixel itself.
        return Texel(i32(whole) - 1, min(rest + 1.0, 0.99999994));
    }
    if rest >= 1.0 {
        return Texel(i32(whole) + 1, rest - 1.0);
    }
    return Texel(i32(whole), rest);
}
