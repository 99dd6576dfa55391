// Counts the pixels of a tile by bin. PRIVATE: in workgroup memory first, then in the table once a group.
//
// Constants: the walk (LANES, TILE), BINS, SLOTS (bins in workgroup memory), CHANNEL, CLAMPED. A thread that meets
// the same bin again only lengthens its run: neighbouring pixels are often alike.

import package::lib::wide::bin_of_pixel;

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
    let first = vec2i(group.xy) * vec2i(TILE_X, TILE_Y);
    let last = min(first + vec2i(TILE_X, TILE_Y), size_image());
    var run = 0;
    var length = 0u;
    for (var y = first.y + i32(local.y); y < last.y; y += LANES_Y) {
        for (var x = first.x + i32(local.x); x < last.x; x += LANES_X) {
            let bin = bin_of_pixel(load_image(vec2i(x, y)), CHANNEL, params.low, params.high, BINS, CLAMPED);
            if bin >= 0 {
                if bin != run {
                    tally(run, length);
                    run = bin;
                    length = 0u;
                }
                length += 1u;
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
