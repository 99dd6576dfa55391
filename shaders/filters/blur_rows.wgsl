// Σ w(k)·in(x − k, y)

fn at(xy: vec2i) -> vec4f {
    var sum = vec4f();
    for (var k = -RADIUS; k <= RADIUS; k++) {
        sum += load_weights(k + RADIUS) * load_image(vec2i(xy.x - k, xy.y));
    }
    return sum;
}
