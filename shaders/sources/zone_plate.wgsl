// 0.5 + 0.5·cos(π·r²/n), n the larger side

fn apply() -> vec4f {
    let size = vec2f(size_out());
    let d = vec2f(pixel()) + 0.5 - 0.5 * size;
    // Turns are taken modulo one before the cosine, which is exact only near 0.
    let turns = fract(dot(d, d) / (2.0 * max(size.x, size.y)));
    return vec4f(0.5 + 0.5 * cos(6.283185307179586 * turns));
}
