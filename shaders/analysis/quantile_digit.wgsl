// From the counts of a digit to the digit that the wanted rank has: one workgroup a target.
//
// Constants: COMPONENTS, TARGETS, ROUND. State of a target: digits found (from the top), rank among the values
// that share them, fraction of the way to the next larger value in units of 2^-32, and after the last round
// whether the next larger value is the same or there is none.

import package::lib::wide::wide_product;

var<workgroup> below: array<u32, 256>;

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let target_index = i32(group.x);
    // All quantiles share the counts of the first round.
    let counted = select(target_index, target_index % COMPONENTS, ROUND == 0u);
    let own = load_counts(counted * 256 + i32(lane));
    below[lane] = own;
    for (var stride = 1u; stride < 256u; stride *= 2u) {
        workgroupBarrier();
        let before = select(0u, below[max(lane, stride) - stride], lane >= stride);
        workgroupBarrier();
        below[lane] += before;
    }
    workgroupBarrier();
    let total = below[255];
    var rank = load_state(4 * target_index + 1);
    var rest = load_state(4 * target_index + 2);
    if ROUND == 0u {
        // h = (n − 1)·q: its whole part and its fraction.
        let fraction = load_fractions(target_index / COMPONENTS);
        let h = wide_product(max(total, 1u) - 1u, fraction);
        rank = h.y;
        rest = h.x;
        if fraction == 0xffffffffu {
            rank = max(total, 1u) - 1u;
            rest = 0u;
        }
    }
    let first = below[lane] - own;
    if own > 0u && first <= rank && rank < below[lane] {
        let shift = 24u - 8u * ROUND;
        store_next(4 * target_index, load_state(4 * target_index) | (lane << shift));
        store_next(4 * target_index + 1, rank - first);
        store_next(4 * target_index + 2, rest);
        store_next(4 * target_index + 3, select(0u, 1u, rank + 1u < below[lane] || rest == 0u));
    }
    if total == 0u && lane == 0u {
        // No value at all: the order of 0, and nothing to interpolate.
        store_next(4 * target_index, 0x80000000u);
        store_next(4 * target_index + 1, 0u);
        store_next(4 * target_index + 2, 0u);
        store_next(4 * target_index + 3, 1u);
    }
}
