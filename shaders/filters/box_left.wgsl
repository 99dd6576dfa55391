// A run of RUN = 2·RADIUS + 1 pixels along one axis: for each the sum of its window up to RADIUS pixels behind the first of the run.

import package::lib::running::{Running, plus, total};

fn each(xy: vec2i) {
    let step = select(vec2i(0, 1), vec2i(1, 0), ALONG_X);
    let start = select(vec2i(xy.x, xy.y * RUN), vec2i(xy.x * RUN, xy.y), ALONG_X);
    var sum = Running();
    for (var i = RUN - 1; i >= 0; i--) {
        sum = plus(sum, load_image(start + step * (i - RADIUS)));
        store_out(start + step * i, total(sum));
    }
}
