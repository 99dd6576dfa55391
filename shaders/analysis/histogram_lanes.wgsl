// As histogram.wgsl for CPUs and few bins: every lane counts in a column of its own, so nothing is atomic until the
// columns are added up. Constants: BINS, CHANNEL, CLAMPED.

import package::lib::wide::{bin_of_pixel, quick_bin_of_pixel};

var<workgroup> tallies: array<u32, BINS * LANES>;

/// The pixel that is too close to an edge to tell.
var<private> close: vec4f;
var<private> doubtful: bool;

fn begin() {
    doubtful = false;
    for (var k = 0; k < BINS; k++) {
        tallies[k * LANES + lane()] = 0u;
    }
}

fn take(xy: vec2i, pixel: vec4f) -> bool {
    let bin = quick_bin_of_pixel(pixel, CHANNEL, params.low, params.high, BINS, CLAMPED);
    close = pixel;
    doubtful = bin == -2;
    if bin >= 0 {
        tallies[bin * LANES + lane()] += 1u;
    }
    return doubtful;
}

fn settle() {
    if doubtful {
        let bin = bin_of_pixel(close, CHANNEL, params.low, params.high, BINS, CLAMPED);
        if bin >= 0 {
            tallies[bin * LANES + lane()] += 1u;
        }
    }
}

fn end() {
    workgroupBarrier();
    for (var k = lane(); k < BINS; k += LANES) {
        var n = 0u;
        for (var j = 0; j < LANES; j++) {
            n += tallies[k * LANES + j];
        }
        if n > 0u {
            add_counts(k, n);
        }
    }
}
