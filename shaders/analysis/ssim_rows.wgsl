// Along rows: the weighted means of a, b, a², b² and a·b of the luminances.

fn each(xy: vec2i) {
    var moments = vec4f();
    var product = 0.0;
    for (var k = -RADIUS; k <= RADIUS; k++) {
        let w = load_weights(k + RADIUS);
        let y = load_luminances(xy + vec2i(k, 0)).xy;
        moments = fma(vec4f(w), vec4f(y, y * y), moments);
        product = fma(w, y.x * y.y, product);
    }
    store_moments(xy, moments);
    store_products(xy, vec4f(product));
}
