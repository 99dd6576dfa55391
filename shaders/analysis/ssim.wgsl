// Along columns, then 1 − similarity from the five means.

fn at(xy: vec2i) -> vec4f {
    var m = vec4f();
    var product = 0.0;
    for (var k = -RADIUS; k <= RADIUS; k++) {
        let w = load_weights(k + RADIUS);
        m += w * load_moments(xy + vec2i(0, k));
        product += w * load_products(xy + vec2i(0, k)).x;
    }
    let variance = max(m.zw - m.xy * m.xy, vec2f());
    let covariance = product - m.x * m.y;
    let similarity = (2.0 * m.x * m.y + params.c1) * (2.0 * covariance + params.c2)
        / ((dot(m.xy, m.xy) + params.c1) * (variance.x + variance.y + params.c2));
    return vec4f(1.0 - similarity);
}
