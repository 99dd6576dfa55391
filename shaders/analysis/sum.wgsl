// Sums of a measure: for each partial the sum, what its rounding lost, and how many values took part.
//
// Partials lie component after component: 12 runs of as many floats as there are partials. Constants: LEFT (partials
// that a group leaves: 1, or one a lane), VIEW (0 channels, 1 luminance, 2 colour and luminance), MEASURE (0 value,
// 1 logarithm, 2 square).

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

fn end() {
    for (var half = LANES / 2; half >= LEFT; half /= 2) {
        if lane() >= half && lane() < 2 * half {
            let at = 3 * (lane() - half);
            scratch_store(at, sum);
            scratch_store(at + 1, error);
            scratch_store(at + 2, count);
        }
        workgroupBarrier();
        if lane() < half {
            let at = 3 * lane();
            let other = scratch_load(at);
            error += scratch_load(at + 1) + sum_error(sum, other);
            sum += other;
            count += scratch_load(at + 2);
        }
        workgroupBarrier();
    }
    if lane() < LEFT {
        leave(group() * LEFT + lane());
    }
}

fn leave(index: i32) {
    let n = size_partials() / 12;
    for (var c = 0; c < 4; c++) {
        store_partials(c * n + index, sum[c]);
        store_partials((4 + c) * n + index, error[c]);
        store_partials((8 + c) * n + index, count[c]);
    }
}
