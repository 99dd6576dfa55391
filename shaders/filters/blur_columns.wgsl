// Σ w(k)·in(x, y − k), for ROWS pixels below each other: each pixel is loaded once for all of them.

fn each(xy: vec2i) {
    let top = xy.y * ROWS;
    var sums = array<vec4f, ROWS>();
    for (var y = top - RADIUS; y < top + ROWS + RADIUS; y++) {
        let v = load_image(vec2i(xy.x, y));
        for (var i = 0; i < ROWS; i++) {
            // Outside −RADIUS..RADIUS a table answers 0, except that a product with infinity must not be made.
            let k = top + i - y + RADIUS;
            if k >= 0 && k <= 2 * RADIUS {
                sums[i] += load_weights(k) * v;
            }
        }
    }
    for (var i = 0; i < ROWS; i++) {
        store_out(vec2i(xy.x, top + i), sums[i]);
    }
}
