// Counts one digit of every value that agrees with the digits found so far, for each quantile and component.
//
// Constants: the walk (LANES, TILE), VIEW (0 channels, 1 luminance, 2 colour and luminance), COMPONENTS, TARGETS
// (quantiles, at most 3), ROUND (0 the highest digit of 8 bits … 3 the lowest). Sets of 256 counts lie quantile
// after quantile, in each component after component. In the first round all quantiles ask for the same counts, and
// the first has them; there neighbours mostly share the digit, so a thread counts runs.

import package::lib::order::orders_of;
import package::lib::wide::viewed;

const SETS = TARGETS * COMPONENTS;
const SHIFT = 24u - 8u * ROUND;

var<workgroup> tallies: array<atomic<u32>, SETS * 256>;

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
    let prefix0 = found(0);
    let prefix1 = found(min(1, TARGETS - 1));
    let prefix2 = found(TARGETS - 1);
    workgroupBarrier();
    // The digits above this one; in the first round there is none, and WGSL shifts by 31 at most.
    let above = vec4u(min(SHIFT + 8u, 31u));
    let first = vec2i(group.xy) * vec2i(TILE_X, TILE_Y);
    let last = min(first + vec2i(TILE_X, TILE_Y), size_image());
    var run = vec4u();
    var length = vec4u();
    for (var y = first.y + i32(local.y); y < last.y; y += LANES_Y) {
        for (var x = first.x + i32(local.x); x < last.x; x += LANES_X) {
            let v = viewed(load_image(vec2i(x, y)), VIEW);
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
                let same0 = finite & (((orders ^ prefix0) >> above) == vec4u());
                if any(same0) {
                    tally(0, digits, same0, one);
                }
                if TARGETS > 1 {
                    let same1 = finite & (((orders ^ prefix1) >> above) == vec4u());
                    if any(same1) {
                        tally(1, digits, same1, one);
                    }
                }
                if TARGETS > 2 {
                    let same2 = finite & (((orders ^ prefix2) >> above) == vec4u());
                    if any(same2) {
                        tally(2, digits, same2, one);
                    }
                }
            }
        }
    }
    if ROUND == 0u {
        tally(0, run, length > vec4u(), length);
    }
    workgroupBarrier();
    for (var i = i32(lane); i < sets * 256; i += LANES_X * LANES_Y) {
        let n = atomicLoad(&tallies[i]);
        if n > 0u {
            add_counts(i, n);
        }
    }
}
