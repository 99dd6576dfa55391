// Along columns, then 1 − similarity from the five means.
//
// Every sum of products is a fused one: where compilers may choose, they choose otherwise in tiles than in whole images.

fn at(xy: vec2i) -> vec4f {
    var m = vec4f();
    var product = 0.0;
    for (var k = -RADIUS; k <= RADIUS; k++) {
        let w = load_weights(k + RADIUS);
        m = fma(vec4f(w), load_moments(xy + vec2i(0, k)), m);
        product = fma(w, load_products(xy + vec2i(0, k)).x, product);
    }
    let variance = max(fma(-m.xy, m.xy, m.zw), vec2f());
    let covariance = fma(-m.x, m.y, product);
    // (2ab + c₁)/(a² + b² + c₁), whose denominator is the numerator and (a − b)².
    let both = fma(2.0 * m.x, m.y, params.c1);
    let luminance = both / fma(m.x - m.y, m.x - m.y, both);
    let structure = fma(2.0, covariance, params.c2) / (variance.x + variance.y + params.c2);
    return vec4f(fma(-luminance, structure, 1.0));
}
