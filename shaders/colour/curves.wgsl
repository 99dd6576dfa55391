// `knots` holds x, y and three coefficients for each point of red, then of green from GREEN, of blue from BLUE to END.

import package::lib::color::keep_nan;

fn curve(v: f32, first: i32, end: i32) -> f32 {
    // The last point that is not beyond v, or the first.
    var low = first;
    var high = end;
    while high - low > 1 {
        let middle = (low + high) / 2;
        if v < load_knots(5 * middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    let d = v - load_knots(5 * low);
    let slope = load_knots(5 * low + 2);
    // Before the first point and beyond the last the curve is straight; where it is level, also for infinity.
    if d < 0.0 || low == end - 1 {
        return load_knots(5 * low + 1) + select(d * slope, 0.0, slope == 0.0);
    }
    return load_knots(5 * low + 1) + d * (slope + d * (load_knots(5 * low + 3) + d * load_knots(5 * low + 4)));
}

fn apply(image: vec4f) -> vec4f {
    let c = vec3f(curve(image.r, 0, GREEN), curve(image.g, GREEN, BLUE), curve(image.b, BLUE, END));
    return vec4f(keep_nan(c, image.rgb), image.a);
}
