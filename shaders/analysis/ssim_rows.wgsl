// Along rows: the weighted means of a, b, a², b² and a·b of the luminances.

import package::lib::wide::exact_luminance;

fn each(xy: vec2i) {
    var moments = vec4f();
    var product = 0.0;
    for (var k = -RADIUS; k <= RADIUS; k++) {
        let w = load_weights(k + RADIUS);
        let at = xy + vec2i(k, 0);
        let a = exact_luminance(load_a(at).rgb);
        let b = exact_luminance(load_b(at).rgb);
        moments += w * vec4f(a, b, a * a, b * b);
        product += w * a * b;
    }
    store_moments(xy, moments);
    store_products(xy, vec4f(product));
}
