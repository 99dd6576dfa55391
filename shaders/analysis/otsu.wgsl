// Otsu's threshold of a histogram of 256 bins over low..high.
//
// With n pixels in the darker class, N in all, s and S the sums of their bin numbers, the variance between the
// classes is proportional to (s·(N − n) − (S − s)·n)²/(n·(N − n)). Quotients are compared crosswise, in pairs of floats,
// so that the same bin wins as in double precision.

import package::lib::wide::{two_sum, wide_add, wide_less, wide_multiply, wide_product};

var<workgroup> counts: array<u32, 256>;

/// An integer of two words as a pair of floats, scaled; its 48 highest bits at least.
fn pair_of(v: vec2u, scale: f32) -> vec2f {
    let low = two_sum(f32(v.x & 0xffff0000u), f32(v.x & 0xffffu));
    let p = wide_add(vec2f(f32(v.y) * 4294967296.0, 0.0), low);
    return p * scale;
}

/// a + b·k of a two-word integer.
fn added(a: vec2u, b: u32, k: u32) -> vec2u {
    let p = wide_product(b, k);
    let low = a.x + p.x;
    return vec2u(low, a.y + p.y + select(0u, 1u, low < p.x));
}

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32) {
    counts[lane] = load_counts(i32(lane));
    workgroupBarrier();
    if lane > 0u {
        return;
    }
    var total = 0u;
    var total_sum = vec2u();
    for (var bin = 0u; bin < 256u; bin++) {
        total += counts[bin];
        total_sum = added(total_sum, counts[bin], bin);
    }
    // Shares of the pixels, so that squares stay in range: an exact power of two.
    let scale = bitcast<f32>((127u - firstLeadingBit(max(total, 1u))) << 23u);
    var below = 0u;
    var sum = vec2u();
    var best = 0u;
    var best_top = vec2f();
    var best_bottom = vec2f(1.0, 0.0);
    for (var bin = 0u; bin < 255u; bin++) {
        below += counts[bin];
        sum = added(sum, counts[bin], bin);
        if below > 0u && below < total {
            let n = pair_of(vec2u(below, 0u), scale);
            let rest = pair_of(vec2u(total - below, 0u), scale);
            let s = pair_of(sum, scale);
            let s_rest = wide_add(pair_of(total_sum, scale), -s);
            let d = wide_add(wide_multiply(s, rest), -wide_multiply(s_rest, n));
            let top = wide_multiply(d, d);
            let bottom = wide_multiply(n, rest);
            if wide_less(wide_multiply(best_top, bottom), wide_multiply(top, best_bottom)) {
                best = bin;
                best_top = top;
                best_bottom = bottom;
            }
        }
    }
    let centre = params.low + (f32(best) + 0.5) / 256.0 * (params.high - params.low);
    store_out(vec4f(select(params.low, centre, params.low < params.high)));
}
