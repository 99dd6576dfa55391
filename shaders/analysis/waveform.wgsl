// Counts the levels of each column. Constants: BINS (levels), COLUMNS of a panel, PANELS: 1 (luminance) or 3.

import package::lib::wide::bin_of_pixel;

fn each(xy: vec2i) {
    let pixel = load_image(xy);
    let column = i32(u32(xy.x) * COLUMNS / u32(size_image().x));
    for (var panel = 0; panel < PANELS; panel++) {
        let channel = select(panel + 1, CHANNEL, PANELS == 1);
        let level = bin_of_pixel(pixel, channel, params.low, params.high, BINS, CLAMPED);
        if level >= 0 {
            add_counts((panel * BINS + level) * i32(COLUMNS) + column, 1u);
        }
    }
}
