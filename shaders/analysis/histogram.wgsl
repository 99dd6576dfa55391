// Counts pixels by bin. PRIVATE: in workgroup memory first, then in the table once a group.
//
// Constants: BINS, SLOTS (bins in workgroup memory), CHANNEL, CLAMPED. A lane that meets the same bin again only
// lengthens its run: neighbouring pixels are often alike. Few pixels need exact arithmetic, so it stands outside of the
// loop over pixels: where threads run in lockstep, or as the lanes of a CPU, code behind a condition would be paid for
// by every pixel.

import package::lib::wide::{bin_of_pixel, quick_bin_of_pixel};

var<workgroup> tallies: array<atomic<u32>, SLOTS>;

var<private> run: i32;
var<private> length: u32;
/// The pixel that is too close to an edge to tell.
var<private> close: vec4f;
var<private> doubtful: bool;

fn tally(bin: i32, n: u32) {
    if n == 0u {
        return;
    }
    if PRIVATE {
        atomicAdd(&tallies[bin], n);
    } else {
        add_counts(bin, n);
    }
}

fn begin() {
    run = 0;
    length = 0u;
    doubtful = false;
    if PRIVATE {
        for (var i = lane(); i < BINS; i += LANES) {
            atomicStore(&tallies[i], 0u);
        }
        workgroupBarrier();
    }
}

fn take(xy: vec2i, pixel: vec4f) -> bool {
    let bin = quick_bin_of_pixel(pixel, CHANNEL, params.low, params.high, BINS, CLAMPED);
    close = pixel;
    doubtful = bin == -2;
    if bin >= 0 {
        if bin != run {
            tally(run, length);
            run = bin;
            length = 0u;
        }
        length += 1u;
    }
    return doubtful;
}

fn settle() {
    if doubtful {
        let bin = bin_of_pixel(close, CHANNEL, params.low, params.high, BINS, CLAMPED);
        if bin >= 0 {
            tally(bin, 1u);
        }
    }
}

fn end() {
    tally(run, length);
    if PRIVATE {
        workgroupBarrier();
        for (var i = lane(); i < BINS; i += LANES) {
            let n = atomicLoad(&tallies[i]);
            if n > 0u {
                add_counts(i, n);
            }
        }
    }
}
