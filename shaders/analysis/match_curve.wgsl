// Where the reference reaches the share of pixels that the image has at both ends of every bin: entry 2·bin for the
// lower end, 2·bin + 1 for the upper. At the lower end a gap in the reference is behind, at the upper still ahead,
// so comparisons are exact: shares are compared as products of counts, in two words.

import package::lib::wide::{wide_below, wide_difference, wide_product};

fn before(bin: i32) -> u32 {
    if bin == 0 {
        return 0u;
    }
    return load_wanted(bin - 1);
}

fn float_of(p: vec2u) -> f32 {
    return f32(p.y) * 4294967296.0 + f32(p.x);
}

fn at(i: i32) -> f32 {
    let bins = size_own();
    let bin = i / 2;
    let upper = i % 2;
    let own_total = load_own(bins - 1);
    let wanted_total = load_wanted(bins - 1);
    var position = f32(bin + upper);
    if own_total > 0u && wanted_total > 0u {
        var count = 0u;
        if bin + upper > 0 {
            count = load_own(bin + upper - 1);
        }
        let share = wide_product(count, wanted_total);
        let strictly = upper == 0 && count < own_total;
        // The first bin whose cumulative share reaches (or passes) this one.
        var low = 0;
        var high = bins - 1;
        while low < high {
            let middle = (low + high) / 2;
            let reached = wide_product(load_wanted(middle), own_total);
            let holds = select(!wide_below(reached, share), wide_below(share, reached), strictly);
            if holds {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        let first = before(low);
        let height = wide_product(load_wanted(low) - first, own_total);
        position = f32(low);
        if height.x != 0u || height.y != 0u {
            position += float_of(wide_difference(share, wide_product(first, own_total))) / float_of(height);
        }
    }
    return params.low + position / f32(bins) * (params.high - params.low);
}
