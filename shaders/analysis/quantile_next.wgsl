// The next larger value of every target, as the complement of its order (so that the smallest is a maximum).
//
// Constants as in quantile_count.wgsl.

import package::lib::order::orders_of;
import package::lib::wide::viewed;

const SETS = TARGETS * COMPONENTS;

var<workgroup> nearest: array<atomic<u32>, SETS>;

var<private> found0: vec4u;
var<private> found1: vec4u;
var<private> found2: vec4u;
var<private> best0: vec4u;
var<private> best1: vec4u;
var<private> best2: vec4u;

fn found(quantile: i32) -> vec4u {
    let first = 4 * quantile * COMPONENTS;
    return vec4u(load_state(first), load_state(first + 4), load_state(first + 8), load_state(first + 12));
}

fn nearer(quantile: i32, best: vec4u) {
    for (var c = 0; c < COMPONENTS; c++) {
        atomicMax(&nearest[quantile * COMPONENTS + c], best[c]);
    }
}

fn begin() {
    found0 = found(0);
    found1 = found(min(1, TARGETS - 1));
    found2 = found(TARGETS - 1);
    best0 = vec4u();
    best1 = vec4u();
    best2 = vec4u();
    if lane() < SETS {
        atomicStore(&nearest[lane()], 0u);
    }
    workgroupBarrier();
}

fn take(xy: vec2i, pixel: vec4f) {
    let v = viewed(pixel, VIEW);
    let finite = (bitcast<vec4u>(v) & vec4u(0x7f800000u)) != vec4u(0x7f800000u);
    let orders = select(vec4u(), orders_of(v), finite);
    best0 = max(best0, select(vec4u(), ~orders, orders > found0));
    best1 = max(best1, select(vec4u(), ~orders, orders > found1));
    best2 = max(best2, select(vec4u(), ~orders, orders > found2));
}

fn end() {
    nearer(0, best0);
    if TARGETS > 1 {
        nearer(1, best1);
    }
    if TARGETS > 2 {
        nearer(2, best2);
    }
    workgroupBarrier();
    if lane() < SETS {
        max_above(lane(), atomicLoad(&nearest[lane()]));
    }
}
