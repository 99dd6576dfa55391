// Each pixel through the curves of the four nearest tiles, interpolated between their centres. NaN passes through.
//
// Constants: TILES_X, TILES_Y, BINS, GREY.

import package::lib::number::is_finite;
import package::lib::wide::{place_in_bins, wide_luminance};

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
    if !is_finite(y) {
        return image;
    }
    var place = place_in_bins(luminance, params.low, params.high, BINS);
    if place.x < 0.0 {
        place = vec2f();
    } else if place.x >= f32(BINS) {
        place = vec2f(f32(BINS - 1), 1.0);
    }
    let tiles = vec2i(TILES_X, TILES_Y);
    let u = (vec2f(pixel()) + 0.5) * vec2f(tiles) / vec2f(size_out()) - 0.5;
    let f = u - floor(u);
    let a = clamp(vec2i(floor(u)), vec2i(), tiles - 1);
    let b = clamp(vec2i(floor(u)) + 1, vec2i(), tiles - 1);
    let upper = mix(level(a, i32(place.x), place.y), level(vec2i(b.x, a.y), i32(place.x), place.y), f.x);
    let lower = mix(level(vec2i(a.x, b.y), i32(place.x), place.y), level(b, i32(place.x), place.y), f.x);
    let h = mix(upper, lower, f.y);
    if GREY {
        return vec4f(h);
    }
    if y <= 0.0 {
        return vec4f(vec3f(), image.a);
    }
    return vec4f(image.rgb / y * h, image.a);
}
