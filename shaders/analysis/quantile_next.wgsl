// The next larger value of every target, as the complement of its order (so that the smallest is a maximum).
//
// Constants as in quantile_count.wgsl.

import package::lib::order::orders_of;
import package::lib::wide::viewed;

const SETS = TARGETS * COMPONENTS;

var<workgroup> nearest: array<atomic<u32>, 12>;

fn found(quantile: i32) -> vec4u {
    let first = 4 * quantile * COMPONENTS;
    return vec4u(load_state(first), load_state(first + 4), load_state(first + 8), load_state(first + 12));
}

fn nearer(quantile: i32, best: vec4u) {
    for (var c = 0; c < COMPONENTS; c++) {
        atomicMax(&nearest[quantile * COMPONENTS + c], best[c]);
    }
}

@compute @workgroup_size(LANES_X, LANES_Y, 1)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let found0 = found(0);
    let found1 = found(min(1, TARGETS - 1));
    let found2 = found(TARGETS - 1);
    var best0 = vec4u();
    var best1 = vec4u();
    var best2 = vec4u();
    if lane < 12u {
        atomicStore(&nearest[lane], 0u);
    }
    workgroupBarrier();
    let first = vec2i(group.xy) * vec2i(TILE_X, TILE_Y);
    let last = min(first + vec2i(TILE_X, TILE_Y), size_image());
    for (var y = first.y + i32(local.y); y < last.y; y += LANES_Y) {
        for (var x = first.x + i32(local.x); x < last.x; x += LANES_X) {
            let v = viewed(load_image(vec2i(x, y)), VIEW);
            let finite = (bitcast<vec4u>(v) & vec4u(0x7f800000u)) != vec4u(0x7f800000u);
            let orders = select(vec4u(), orders_of(v), finite);
            best0 = max(best0, select(vec4u(), ~orders, orders > found0));
            best1 = max(best1, select(vec4u(), ~orders, orders > found1));
            best2 = max(best2, select(vec4u(), ~orders, orders > found2));
        }
    }
    nearer(0, best0);
    if TARGETS > 1 {
        nearer(1, best1);
    }
    if TARGETS > 2 {
        nearer(2, best2);
    }
    workgroupBarrier();
    if lane < u32(SETS) {
        max_above(i32(lane), atomicLoad(&nearest[lane]));
    }
}
