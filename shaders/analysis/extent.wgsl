// Smallest and largest finite value, and how many values are NaN or infinite. Constants: VIEW (0 channels, 1 luminance,
// 2 colour and luminance). See partials.wgsl, which stands behind this file.

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

fn part(i: i32) -> vec4f {
    return array(low, high, nans, infs)[i];
}

fn absorb(at: i32) {
    low = min(low, scratch_load(at));
    high = max(high, scratch_load(at + 1));
    nans += scratch_load(at + 2);
    infs += scratch_load(at + 3);
}
