// Each pixel through the curves of the four nearest tiles, interpolated between their centres. NaN passes through.
//
// Constants: TILES_X, TILES_Y, BINS, GREY.

import package::lib::number::is_nan;
import package::lib::wide::{bin_fraction, bin_index, wide_luminance};

/// A place in a bin through the curve of a tile: straight inside a bin.
fn level(tile: vec2i, bin: i32, inside: f32) -> f32 {
    let curve = (tile.y * TILES_X + tile.x) * BINS;
    var below = 0.0;
    if bin > 0 {
        below = load_curves(curve + bin - 1);
    }
    return mix(below, load_curves(curve + bin), inside);
}

fn apply(image: vec4f) -> vec4f {
    let luminance = wide_luminance(image.rgb);
    let y = luminance.x;
    if is_nan(y) {
        return image;
    }
    let bin = clamp(bin_index(luminance, params.low, params.high, BINS), 0, BINS - 1);
    let inside = bin_fraction(luminance, params.low, params.high, BINS, bin);
    let tiles = vec2i(TILES_X, TILES_Y);
    let u = (vec2f(pixel()) + 0.5) * vec2f(tiles) / vec2f(size_out()) - 0.5;
    let f = u - floor(u);
    let a = clamp(vec2i(floor(u)), vec2i(), tiles - 1);
    let b = clamp(vec2i(floor(u)) + 1, vec2i(), tiles - 1);
    let upper = mix(level(a, bin, inside), level(vec2i(b.x, a.y), bin, inside), f.x);
    let lower = mix(level(vec2i(a.x, b.y), bin, inside), level(b, bin, inside), f.x);
    let h = mix(upper, lower, f.y);
    if GREY {
        return vec4f(h);
    }
    if y <= 0.0 {
        return vec4f(vec3f(), image.a);
    }
    return vec4f(image.rgb / y * h, image.a);
}
