// Each channel through the curve of its bins, straight between the ends of a bin. NaN passes through.

import package::lib::number::is_nan;
import package::lib::wide::{bin_fraction, bin_index};

struct Place {
    bin: i32,
    inside: f32,
}

fn place(v: f32) -> Place {
    let bin = clamp(bin_index(vec2f(v, 0.0), params.low, params.high, BINS), 0, BINS - 1);
    return Place(bin, bin_fraction(vec2f(v, 0.0), params.low, params.high, BINS, bin));
}

fn apply(image: vec4f) -> vec4f {
    var out = image;
    if !is_nan(image.r) {
        let p = place(image.r);
        out.r = mix(load_red(2 * p.bin), load_red(2 * p.bin + 1), p.inside);
    }
    if !is_nan(image.g) {
        let p = place(image.g);
        out.g = mix(load_green(2 * p.bin), load_green(2 * p.bin + 1), p.inside);
    }
    if !is_nan(image.b) {
        let p = place(image.b);
        out.b = mix(load_blue(2 * p.bin), load_blue(2 * p.bin + 1), p.inside);
    }
    return out;
}
