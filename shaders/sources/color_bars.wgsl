// Bits of the bar's number say which channels are on.

fn apply() -> vec4f {
    let bar = 7 - min(pixel().x * 8 / size_out().x, 7);
    return vec4f(0.75 * vec3f(f32((bar >> 1u) & 1), f32((bar >> 2u) & 1), f32(bar & 1)), 1.0);
}
