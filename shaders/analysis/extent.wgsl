// Smallest and largest finite value, and how many values are NaN or infinite: 16 runs of as many floats as there are
// partials. Constants: LEFT (partials that a group leaves: 1, or one a lane), VIEW (0 channels, 1 luminance, 2 colour
// and luminance).

import package::lib::wide::viewed;

const LARGEST = 3.4028234663852886e38;

var<private> low: vec4f;
var<private> high: vec4f;
var<private> nans: vec4f;
var<private> infs: vec4f;

fn begin() {
    low = vec4f(LARGEST);
    high = vec4f(-LARGEST);
    nans = vec4f();
    infs = vec4f();
}

fn take(xy: vec2i, pixel: vec4f) {
    let v = viewed(pixel, VIEW);
    let magnitude = bitcast<vec4u>(v) & vec4u(0x7fffffffu);
    let finite = magnitude < vec4u(0x7f800000u);
    low = select(low, min(low, v), finite);
    high = select(high, max(high, v), finite);
    nans += select(vec4f(), vec4f(1.0), magnitude > vec4u(0x7f800000u));
    infs += select(vec4f(), vec4f(1.0), magnitude == vec4u(0x7f800000u));
}

fn end() {
    for (var half = LANES / 2; half >= LEFT; half /= 2) {
        if lane() >= half && lane() < 2 * half {
            let at = 4 * (lane() - half);
            scratch_store(at, low);
            scratch_store(at + 1, high);
            scratch_store(at + 2, nans);
            scratch_store(at + 3, infs);
        }
        workgroupBarrier();
        if lane() < half {
            let at = 4 * lane();
            low = min(low, scratch_load(at));
            high = max(high, scratch_load(at + 1));
            nans += scratch_load(at + 2);
            infs += scratch_load(at + 3);
        }
        workgroupBarrier();
    }
    if lane() < LEFT {
        leave(group() * LEFT + lane());
    }
}

fn leave(index: i32) {
    let n = size_partials() / 16;
    for (var c = 0; c < 4; c++) {
        store_partials(c * n + index, low[c]);
        store_partials((4 + c) * n + index, high[c]);
        store_partials((8 + c) * n + index, nans[c]);
        store_partials((12 + c) * n + index, infs[c]);
    }
}
