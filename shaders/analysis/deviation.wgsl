// The spread of values about their mean in one walk: how many took part, their mean, and the sum of their squared
// distances from it.
//
// Welford's recurrence (Technometrics 4, 1962) for a lane, Chan, Golub and LeVeque's combination (The American
// Statistician 37, 1983) for two. Means are told as a value of the image and the distance from it, which is short where
// values lie close together far from zero: the difference of two of them loses nothing there. Partials lie component
// after component: 16 runs of as many floats as there are partials. Constants: LEFT (partials that a group leaves: 1, or
// one a lane), VIEW (0 channels, 1 luminance, 2 colour and luminance).

import package::lib::moments::{Moments, joined_moments};
import package::lib::wide::viewed;

var<private> moments: Moments;

fn begin() {
    moments = Moments(vec4f(), vec4f(), vec4f(), vec4f());
}

fn take(xy: vec2i, pixel: vec4f) {
    let v = viewed(pixel, VIEW);
    let finite = (bitcast<vec4u>(v) & vec4u(0x7f800000u)) != vec4u(0x7f800000u);
    let origin = select(moments.origin, v, finite & (moments.count == vec4f()));
    let count = moments.count + select(vec4f(), vec4f(1.0), finite);
    let distance = select(moments.mean, v - origin, finite);
    let step = distance - moments.mean;
    let mean = moments.mean + step / max(count, vec4f(1.0));
    moments = Moments(count, origin, mean, moments.squares + step * (distance - mean));
}

fn end() {
    for (var half = LANES / 2; half >= LEFT; half /= 2) {
        if lane() >= half && lane() < 2 * half {
            let at = 4 * (lane() - half);
            scratch_store(at, moments.count);
            scratch_store(at + 1, moments.origin);
            scratch_store(at + 2, moments.mean);
            scratch_store(at + 3, moments.squares);
        }
        workgroupBarrier();
        if lane() < half {
            let at = 4 * lane();
            let other = Moments(scratch_load(at), scratch_load(at + 1), scratch_load(at + 2), scratch_load(at + 3));
            moments = joined_moments(moments, other);
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
        store_partials(c * n + index, moments.count[c]);
        store_partials((4 + c) * n + index, moments.origin[c]);
        store_partials((8 + c) * n + index, moments.mean[c]);
        store_partials((12 + c) * n + index, moments.squares[c]);
    }
}
