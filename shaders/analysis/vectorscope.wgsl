// Counts each pixel in the cell of its chroma. Constants: SIZE of the scope.

import package::lib::number::is_finite;
import package::lib::wide::{bin_index, wide_add, wide_luminance, wide_multiply};

fn each(xy: vec2i) {
    let pixel = load_image(xy);
    let y = wide_luminance(pixel.rgb);
    if !is_finite(y.x) || !is_finite(pixel.r) || !is_finite(pixel.b) {
        return;
    }
    // 1/1.8556 and 1/1.5748 as pairs.
    let cb = wide_multiply(wide_add(vec2f(pixel.b, 0.0), -y), vec2f(0.53890926, -8.775592e-09));
    let cr = wide_multiply(wide_add(vec2f(pixel.r, 0.0), -y), vec2f(0.63500124, 2.7841743e-08));
    let column = bin_index(cb, -params.extent, params.extent, SIZE);
    let row = bin_index(cr, -params.extent, params.extent, SIZE);
    if column >= 0 && column < SIZE && row >= 0 && row < SIZE {
        add_counts(row * SIZE + column, 1u);
    }
}
