// The share of the way from the first pixel to the last.

fn apply() -> vec4f {
    let at = select(pixel().y, pixel().x, ALONG_X);
    let n = select(size_out().y, size_out().x, ALONG_X);
    return mix(params.first, params.last, f32(at) / f32(max(n - 1, 1)));
}
