// Sums of a measure: for each partial the sum, what its rounding lost, and how many values took part.
//
// Constants: VIEW (0 channels, 1 luminance, 2 colour and luminance), MEASURE (0 value, 1 logarithm, 2 square). See
// partials.wgsl, which stands behind this file.

import package::lib::wide::{sum_error, viewed};

var<private> sum: vec4f;
var<private> error: vec4f;
var<private> count: vec4f;

fn measure(v: vec4f) -> vec4f {
    if MEASURE == 1 {
        return log(params.epsilon + max(v, vec4f(0.0)));
    }
    if MEASURE == 2 {
        return v * v;
    }
    return v;
}

fn begin() {
    sum = vec4f();
    error = vec4f();
    count = vec4f();
}

fn take(xy: vec2i, pixel: vec4f) {
    let v = viewed(pixel, VIEW);
    let finite = (bitcast<vec4u>(v) & vec4u(0x7f800000u)) != vec4u(0x7f800000u);
    let term = select(vec4f(), measure(v), finite);
    error += sum_error(sum, term);
    sum += term;
    count += select(vec4f(), vec4f(1.0), finite);
}

fn part(i: i32) -> vec4f {
    return array(sum, error, count)[i];
}

fn absorb(at: i32) {
    let other = scratch_load(at);
    error += scratch_load(at + 1) + sum_error(sum, other);
    sum += other;
    count += scratch_load(at + 2);
}
