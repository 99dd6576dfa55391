// The next larger value of every target, as the complement of its order (so that the smallest is a maximum).
//
// Constants as in quantile_count.wgsl.

import package::lib::number::is_finite;
import package::lib::order::order_of;
import package::lib::wide::viewed;

const SETS = TARGETS * COMPONENTS;

var<workgroup> nearest: array<atomic<u32>, SETS>;

@compute @workgroup_size(LANES_X, LANES_Y, 1)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    var orders = array<u32, SETS>();
    var best = array<u32, SETS>();
    for (var s = 0; s < SETS; s++) {
        orders[s] = load_state(4 * s);
    }
    if lane < u32(SETS) {
        atomicStore(&nearest[lane], 0u);
    }
    workgroupBarrier();
    let first = vec2i(group.xy) * vec2i(TILE_X, TILE_Y);
    let last = min(first + vec2i(TILE_X, TILE_Y), size_image());
    for (var y = first.y + i32(local.y); y < last.y; y += LANES_Y) {
        for (var x = first.x + i32(local.x); x < last.x; x += LANES_X) {
            let v = viewed(load_image(vec2i(x, y)), VIEW);
            for (var c = 0; c < COMPONENTS; c++) {
                if is_finite(v[c]) {
                    let order = order_of(v[c]);
                    for (var s = c; s < SETS; s += COMPONENTS) {
                        if order > orders[s] {
                            best[s] = max(best[s], ~order);
                        }
                    }
                }
            }
        }
    }
    for (var s = 0; s < SETS; s++) {
        if best[s] > 0u {
            atomicMax(&nearest[s], best[s]);
        }
    }
    workgroupBarrier();
    if lane < u32(SETS) {
        max_above(i32(lane), atomicLoad(&nearest[lane]));
    }
}
