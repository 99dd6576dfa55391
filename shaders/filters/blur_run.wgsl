// Σ w(k)·in(x − k) along one axis, for RUN neighbours: each pixel is loaded once for all of them.

fn each(xy: vec2i) {
    let along = select(vec2i(0, 1), vec2i(1, 0), ALONG_X);
    let first = select(vec2i(xy.x, xy.y * RUN), vec2i(xy.x * RUN, xy.y), ALONG_X);
    var sums = array<vec4f, RUN>();
    for (var n = -RADIUS; n < RUN + RADIUS; n++) {
        let v = load_image(first + along * n);
        for (var i = 0; i < RUN; i++) {
            // Outside −RADIUS..RADIUS a table answers 0, except that a product with infinity must not be made.
            let k = i - n + RADIUS;
            if k >= 0 && k <= 2 * RADIUS {
                sums[i] += load_weights(k) * v;
            }
        }
    }
    for (var i = 0; i < RUN; i++) {
        store_out(first + along * i, sums[i]);
    }
}
