// The mean over the window (2·radius + 1)², clipped to the image: four reads, 0 left of and above the table.

fn at(xy: vec2i) -> vec4f {
    let a = max(xy - params.radius, vec2i()) - 1;
    let b = min(xy + params.radius, size_sat() - 1);
    let upper = load_sat(vec2i(b.x, a.y)) - load_sat(a);
    let lower = load_sat(b) - load_sat(vec2i(a.x, b.y));
    return (lower - upper) / f32((b.x - a.x) * (b.y - a.y));
}
