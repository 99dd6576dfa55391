// Counts one digit of every value that agrees with the digits found so far, for each quantile and component.
//
// Constants: the walk (LANES, TILE), VIEW (0 channels, 1 luminance, 2 colour and luminance), COMPONENTS, TARGETS
// (quantiles), ROUND (0 the highest digit of 8 bits … 3 the lowest). Targets lie quantile after quantile, in each
// component after component. In the first round all quantiles ask for the same counts, and the first has them.

import package::lib::number::is_finite;
import package::lib::order::order_of;
import package::lib::wide::viewed;

const SETS = TARGETS * COMPONENTS;

var<workgroup> tallies: array<atomic<u32>, SETS * 256>;

@compute @workgroup_size(LANES_X, LANES_Y, 1)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let sets = select(SETS, COMPONENTS, ROUND == 0u);
    for (var i = i32(lane); i < sets * 256; i += LANES_X * LANES_Y) {
        atomicStore(&tallies[i], 0u);
    }
    var prefixes = array<u32, SETS>();
    for (var s = 0; s < sets; s++) {
        prefixes[s] = load_state(4 * s);
    }
    workgroupBarrier();
    let shift = 24u - 8u * ROUND;
    let first = vec2i(group.xy) * vec2i(TILE_X, TILE_Y);
    let last = min(first + vec2i(TILE_X, TILE_Y), size_image());
    for (var y = first.y + i32(local.y); y < last.y; y += LANES_Y) {
        for (var x = first.x + i32(local.x); x < last.x; x += LANES_X) {
            let v = viewed(load_image(vec2i(x, y)), VIEW);
            for (var c = 0; c < COMPONENTS; c++) {
                if is_finite(v[c]) {
                    let order = order_of(v[c]);
                    let digit = i32((order >> shift) & 255u);
                    for (var s = c; s < sets; s += COMPONENTS) {
                        // The digits above this one; nothing lies above the first, and WGSL shifts by 31 at most.
                        if ROUND == 0u || ((order ^ prefixes[s]) >> min(shift + 8u, 31u)) == 0u {
                            atomicAdd(&tallies[s * 256 + digit], 1u);
                        }
                    }
                }
            }
        }
    }
    workgroupBarrier();
    for (var i = i32(lane); i < sets * 256; i += LANES_X * LANES_Y) {
        let n = atomicLoad(&tallies[i]);
        if n > 0u {
            add_counts(i, n);
        }
    }
}
