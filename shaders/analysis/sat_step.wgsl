// One step of a prefix sum along x (AXIS 0) or y: RADIX pixels, STRIDE apart, ending at this one.

fn at(xy: vec2i) -> vec4f {
    let stride = select(vec2i(STRIDE, 0), vec2i(0, STRIDE), AXIS == 1);
    var sum = vec4f();
    for (var k = RADIX - 1; k >= 0; k--) {
        let place = xy - k * stride;
        if all(place >= vec2i()) {
            sum += load_sums(place);
        }
    }
    return sum;
}
