// Along rows. Colours: the achromatic, red–green and both blue–yellow sensitivities. Features: the achromatic
// colour smoothed, and filtered for edges and for points.
//
// Weights lie one after another, 2·RADIUS + 1 each: achromatic, red–green, blue–yellow twice, smooth, edge, point.

fn each(xy: vec2i) {
    var colours = vec4f();
    var features = vec4f();
    let n = 2 * RADIUS + 1;
    for (var k = 0; k < n; k++) {
        let c = load_opponent(xy + vec2i(k - RADIUS, 0));
        colours += vec4f(load_weights(k), load_weights(n + k), load_weights(2 * n + k), load_weights(3 * n + k)) * c.xyzz;
        features += vec4f(load_weights(4 * n + k), load_weights(5 * n + k), load_weights(6 * n + k), 0.0) * c.x;
    }
    store_colours(xy, colours);
    store_features(xy, features);
}
