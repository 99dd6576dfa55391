// Counts one digit of every value that agrees with the digits found so far, for each quantile and component.
//
// Constants: VIEW (0 channels, 1 luminance, 2 colour and luminance), COMPONENTS, TARGETS
// (quantiles, at most 3), ROUND (0 the highest digit of 8 bits … 3 the lowest). Sets of 256 counts lie quantile
// after quantile, in each component after component. In the first round all quantiles ask for the same counts, and
// the first has them; there neighbours mostly share the digit, so a lane counts runs.

import package::lib::order::orders_of;
import package::lib::wide::viewed;

/// In the first round all quantiles share the sets of one.
const SETS = select(TARGETS, 1, ROUND == 0u) * COMPONENTS;
const SHIFT = 24u - 8u * ROUND;

/// The digits above the counted one; in the first round there is none, and WGSL shifts by 31 at most.
const ABOVE = min(SHIFT + 8u, 31u);

var<workgroup> tallies: array<atomic<u32>, SETS * 256>;

var<private> prefix0: vec4u;
var<private> prefix1: vec4u;
var<private> prefix2: vec4u;
var<private> run: vec4u;
var<private> length: vec4u;

fn found(quantile: i32) -> vec4u {
    let first = 4 * quantile * COMPONENTS;
    return vec4u(load_state(first), load_state(first + 4), load_state(first + 8), load_state(first + 12));
}

/// Counts the digits of the components that are asked for.
fn tally(quantile: i32, digits: vec4u, asked: vec4<bool>, n: vec4u) {
    let set_of = quantile * COMPONENTS;
    if asked.x {
        atomicAdd(&tallies[u32(set_of) * 256u + digits.x], n.x);
    }
    if COMPONENTS > 1 && asked.y {
        atomicAdd(&tallies[u32(set_of + 1) * 256u + digits.y], n.y);
    }
    if COMPONENTS > 2 && asked.z {
        atomicAdd(&tallies[u32(set_of + 2) * 256u + digits.z], n.z);
    }
    if COMPONENTS > 3 && asked.w {
        atomicAdd(&tallies[u32(set_of + 3) * 256u + digits.w], n.w);
    }
}

fn begin() {
    for (var i = lane(); i < SETS * 256; i += LANES) {
        atomicStore(&tallies[i], 0u);
    }
    prefix0 = found(0);
    prefix1 = found(min(1, TARGETS - 1));
    prefix2 = found(TARGETS - 1);
    run = vec4u();
    length = vec4u();
    workgroupBarrier();
}

fn take(xy: vec2i, pixel: vec4f) {
    let v = viewed(pixel, VIEW);
    let finite = (bitcast<vec4u>(v) & vec4u(0x7f800000u)) != vec4u(0x7f800000u);
    let orders = orders_of(v);
    let digits = (orders >> vec4u(SHIFT)) & vec4u(255u);
    if ROUND == 0u {
        let ends = finite & (digits != run);
        if any(ends) {
            tally(0, run, ends & (length > vec4u()), length);
            run = select(run, digits, ends);
            length = select(length, vec4u(), ends);
        }
        length += select(vec4u(), vec4u(1u), finite);
    } else {
        let one = vec4u(1u);
        let same0 = finite & (((orders ^ prefix0) >> vec4u(ABOVE)) == vec4u());
        if any(same0) {
            tally(0, digits, same0, one);
        }
        if TARGETS > 1 {
            let same1 = finite & (((orders ^ prefix1) >> vec4u(ABOVE)) == vec4u());
            if any(same1) {
                tally(1, digits, same1, one);
            }
        }
        if TARGETS > 2 {
            let same2 = finite & (((orders ^ prefix2) >> vec4u(ABOVE)) == vec4u());
            if any(same2) {
                tally(2, digits, same2, one);
            }
        }
    }
}

fn end() {
    if ROUND == 0u {
        tally(0, run, length > vec4u(), length);
    }
    workgroupBarrier();
    for (var i = lane(); i < SETS * 256; i += LANES) {
        let n = atomicLoad(&tallies[i]);
        if n > 0u {
            add_counts(i, n);
        }
    }
}
