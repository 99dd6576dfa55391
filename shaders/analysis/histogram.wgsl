// Counts the pixels of a tile by bin. PRIVATE: in workgroup memory first, then in the table once a group.
//
// Constants: the walk (LANES, TILE), BINS, SLOTS (bins in workgroup memory), CHANNEL, CLAMPED. A thread that meets
// the same bin again only lengthens its run: neighbouring pixels are often alike. Few pixels need exact arithmetic,
// so a thread leaves the quick loop at those: where threads run in lockstep, or as the lanes of a CPU, code behind
// a condition would be paid for by every pixel.

import package::lib::wide::{bin_of_pixel, quick_bin_of_pixel};

const ACROSS = (TILE_X + LANES_X - 1) / LANES_X;
const DOWN = (TILE_Y + LANES_Y - 1) / LANES_Y;

var<workgroup> tallies: array<atomic<u32>, SLOTS>;

fn tally(bin: i32, length: u32) {
    if length == 0u {
        return;
    }
    if PRIVATE {
        atomicAdd(&tallies[bin], length);
    } else {
        add_counts(bin, length);
    }
}

@compute @workgroup_size(LANES_X, LANES_Y, 1)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    if PRIVATE {
        for (var i = i32(lane); i < BINS; i += LANES_X * LANES_Y) {
            atomicStore(&tallies[i], 0u);
        }
        workgroupBarrier();
    }
    let size = size_image();
    let first = vec2i(group.xy) * vec2i(TILE_X, TILE_Y) + vec2i(local.xy);
    let end = ACROSS * min(DOWN, (size.y - first.y + LANES_Y - 1) / LANES_Y);
    var run = 0;
    var length = 0u;
    var i = 0;
    while i < end {
        var pixel = vec4f();
        var bin = -1;
        while i < end {
            let xy = first + vec2i(i % ACROSS, i / ACROSS) * vec2i(LANES_X, LANES_Y);
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
                if bin != run {
                    tally(run, length);
                    run = bin;
                    length = 0u;
                }
                length += 1u;
            }
        }
        if bin == -2 {
            bin = bin_of_pixel(pixel, CHANNEL, params.low, params.high, BINS, CLAMPED);
            if bin >= 0 {
                tally(bin, 1u);
            }
        }
    }
    tally(run, length);
    if PRIVATE {
        workgroupBarrier();
        for (var i = i32(lane); i < BINS; i += LANES_X * LANES_Y) {
            let n = atomicLoad(&tallies[i]);
            if n > 0u {
                add_counts(i, n);
            }
        }
    }
}
