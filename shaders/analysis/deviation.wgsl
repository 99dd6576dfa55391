// The spread of values about their mean in one walk: how many took part, their mean, and the sum of their squared
// distances from it.
//
// Welford's recurrence (Technometrics 4, 1962) for a lane, Chan, Golub and LeVeque's combination (The American
// Statistician 37, 1983) for two. Means are told as a value of the image and the distance from it, which is short where
// values lie close together far from zero: the difference of two of them loses nothing there. Constants: VIEW (0 channels,
// 1 luminance, 2 colour and luminance). See partials.wgsl, which stands behind this file.

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

fn part(i: i32) -> vec4f {
    return array(moments.count, moments.origin, moments.mean, moments.squares)[i];
}

fn absorb(at: i32) {
    moments = joined_moments(moments, Moments(scratch_load(at), scratch_load(at + 1), scratch_load(at + 2), scratch_load(at + 3)));
}
