// Counts each pixel in the cell of two of its channels. Constants: BINS, CHANNEL (along x), CHANNEL_Y, CLAMPED.

import package::lib::wide::bin_of_pixel;

fn each(xy: vec2i) {
    let pixel = load_image(xy);
    let x = bin_of_pixel(pixel, CHANNEL, params.low, params.high, BINS, CLAMPED);
    let y = bin_of_pixel(pixel, CHANNEL_Y, params.low, params.high, BINS, CLAMPED);
    if x >= 0 && y >= 0 {
        add_counts(y * BINS + x, 1u);
    }
}
