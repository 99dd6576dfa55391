// RUN neighbouring means along one axis. All windows hold the pixels from RUN − 1 − RADIUS to RADIUS. What a window holds to
// the left of them is summed from the right, what it holds to the right from the left: nothing is ever taken away from a
// sum, so no window knows anything of what left it.

fn each(xy: vec2i) {
    let step = select(vec2i(0, 1), vec2i(1, 0), ALONG_X);
    let start = select(vec2i(xy.x, xy.y * RUN), vec2i(xy.x * RUN, xy.y), ALONG_X);
    var left = array<vec4f, RUN>();
    for (var i = RUN - 2; i >= 0; i--) {
        left[i] = left[i + 1] + load_image(start + step * (i - RADIUS));
    }
    var sum = vec4f();
    for (var k = RUN - 1 - RADIUS; k <= RADIUS; k++) {
        sum += load_image(start + step * k);
    }
    let scale = 1.0 / f32(2 * RADIUS + 1);
    store_out(start, (left[0] + sum) * scale);
    for (var i = 1; i < RUN; i++) {
        sum += load_image(start + step * (i + RADIUS));
        store_out(start + step * i, (left[i] + sum) * scale);
    }
}
