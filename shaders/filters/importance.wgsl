// The mean of samples at given offsets along one axis, each interpolated between two pixels.

fn at(xy: vec2i) -> vec4f {
    var sum = vec4f();
    for (var i = 0; i < SAMPLES; i++) {
        let offset = load_offsets(i);
        let whole = floor(offset);
        let f = offset - whole;
        let step = select(vec2i(0, 1), vec2i(1, 0), ALONG_X);
        let p = xy + step * i32(whole);
        sum += mix(load_image(p), load_image(p + step), f);
    }
    return sum / f32(SAMPLES);
}
