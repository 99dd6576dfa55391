// Each channel through the curve of its bins, straight between the ends of a bin. NaN and infinity pass through.

import package::lib::number::is_finite;
import package::lib::wide::place_in_bins;

/// The bin and the place inside it, of a value brought into the range.
fn place(v: f32) -> vec2f {
    return place_in_bins(vec2f(clamp(v, params.low, params.high), 0.0), params.low, params.high, BINS);
}

fn apply(image: vec4f) -> vec4f {
    var out = image;
    let r = place(image.r);
    let g = place(image.g);
    let b = place(image.b);
    if is_finite(image.r) {
        out.r = mix(load_red(2 * i32(r.x)), load_red(2 * i32(r.x) + 1), r.y);
    }
    if is_finite(image.g) {
        out.g = mix(load_green(2 * i32(g.x)), load_green(2 * i32(g.x) + 1), g.y);
    }
    if is_finite(image.b) {
        out.b = mix(load_blue(2 * i32(b.x)), load_blue(2 * i32(b.x) + 1), b.y);
    }
    return out;
}
