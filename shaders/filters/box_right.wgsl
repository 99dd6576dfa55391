// The means of the same run: what box_left.wgsl left, and the sum of the rest of each window.

import package::lib::running::{Running, plus, total};

fn each(xy: vec2i) {
    let step = select(vec2i(0, 1), vec2i(1, 0), ALONG_X);
    let start = select(vec2i(xy.x, xy.y * RUN), vec2i(xy.x * RUN, xy.y), ALONG_X);
    let scale = 1.0 / f32(RUN);
    var sum = Running();
    for (var i = 0; i < RUN; i++) {
        if i > 0 {
            sum = plus(sum, load_image(start + step * (i + RADIUS)));
        }
        let p = start + step * i;
        store_out(p, (load_left(p) + total(sum)) * scale);
    }
}
