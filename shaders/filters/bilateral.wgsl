// The mean of the pixels around, near and similar ones first.

fn at(xy: vec2i) -> vec4f {
    let here = load_image(xy);
    var sum = vec4f();
    var total = 0.0;
    for (var dy = -RADIUS; dy <= RADIUS; dy++) {
        for (var dx = -RADIUS; dx <= RADIUS; dx++) {
            let v = load_image(xy + vec2i(dx, dy));
            let d = v.rgb - here.rgb;
            // One channel is loaded as three equal ones.
            let distance = select(dot(d, d), d.r * d.r, GREY);
            let weight = exp(params.space * f32(dx * dx + dy * dy) + params.range * distance);
            sum += weight * v;
            total += weight;
        }
    }
    return sum / total;
}
