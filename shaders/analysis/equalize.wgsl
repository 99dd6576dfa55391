// Each pixel to the level of its bin: colours scaled by H/Y, grey images set to H. NaN and infinity pass through.

import package::lib::wide::{bin_of_pixel, exact_luminance};

fn apply(image: vec4f) -> vec4f {
    let bin = bin_of_pixel(image, CHANNEL, params.low, params.high, BINS, CLAMPED);
    if bin < 0 {
        return image;
    }
    let level = load_curve(bin);
    if GREY {
        return vec4f(level);
    }
    let y = exact_luminance(image.rgb);
    if y <= 0.0 {
        return vec4f(vec3f(), image.a);
    }
    return vec4f(image.rgb / y * level, image.a);
}
