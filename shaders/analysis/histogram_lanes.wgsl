// As histogram.wgsl for CPUs and few bins: every lane counts in a column of its own, so nothing is atomic until the
// columns are added up. Constants: the walk (LANES_X, TILE), BINS, CHANNEL, CLAMPED.

import package::lib::wide::{bin_of_pixel, quick_bin_of_pixel};

const ACROSS = (TILE_X + LANES_X - 1) / LANES_X;

var<workgroup> tallies: array<u32, BINS * LANES_X>;

@compute @workgroup_size(LANES_X, 1, 1)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let own = i32(lane);
    for (var k = 0; k < BINS; k++) {
        tallies[k * LANES_X + own] = 0u;
    }
    let size = size_image();
    let first = vec2i(group.xy) * vec2i(TILE_X, TILE_Y) + vec2i(own, 0);
    let end = ACROSS * min(TILE_Y, size.y - first.y);
    var i = 0;
    while i < end {
        var pixel = vec4f();
        var bin = -1;
        while i < end {
            let xy = first + vec2i(i % ACROSS * LANES_X, i / ACROSS);
            i += 1;
            bin = -1;
            if xy.x < size.x {
                pixel = load_image(xy);
                bin = quick_bin_of_pixel(pixel, CHANNEL, params.low, params.high, BINS, CLAMPED);
            }
            if bin == -2 {
                break;
            }
            if bin >= 0 {
                tallies[bin * LANES_X + own] += 1u;
            }
        }
        if bin == -2 {
            bin = bin_of_pixel(pixel, CHANNEL, params.low, params.high, BINS, CLAMPED);
            if bin >= 0 {
                tallies[bin * LANES_X + own] += 1u;
            }
        }
    }
    workgroupBarrier();
    for (var k = own; k < BINS; k += LANES_X) {
        var n = 0u;
        for (var j = 0; j < LANES_X; j++) {
            n += tallies[k * LANES_X + j];
        }
        if n > 0u {
            add_counts(k, n);
        }
    }
}
