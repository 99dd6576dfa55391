// A run of RUN means along one axis, each from the one before. Sums carry their rounding error along (Neumaier).

fn each(xy: vec2i) {
    let step = select(vec2i(0, 1), vec2i(1, 0), ALONG_X);
    let start = select(vec2i(xy.x, xy.y * RUN), vec2i(xy.x * RUN, xy.y), ALONG_X);
    var sum = vec4f();
    var lost = vec4f();
    for (var k = -RADIUS; k <= RADIUS; k++) {
        let v = load_image(start + step * k);
        let t = sum + v;
        lost += select((v - t) + sum, (sum - t) + v, abs(sum) >= abs(v));
        sum = t;
    }
    let scale = 1.0 / f32(2 * RADIUS + 1);
    store_out(start, (sum + lost) * scale);
    for (var i = 1; i < RUN; i++) {
        let p = start + step * i;
        let v = load_image(p + step * RADIUS) - load_image(p - step * (RADIUS + 1));
        let t = sum + v;
        lost += select((v - t) + sum, (sum - t) + v, abs(sum) >= abs(v));
        sum = t;
        store_out(p, (sum + lost) * scale);
    }
}
