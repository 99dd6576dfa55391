// Arithmetic wider than 32 bits: an unevaluated sum of two floats, and products of integers as two words.
//
// Sums of many terms carry what rounding loses (Knuth's two-sum), products are exact by Dekker's splitting:
// Shewchuk, Adaptive Precision Floating-Point Arithmetic, 1997. Neither needs a fused multiply-add, which some
// devices do not have; what is done about devices that have one and use it unasked is said below.

/// The largest finite float. `min(x, LARGEST_FLOAT)` is x, but no compiler knows: it keeps Mesa and Metal, which may
/// rearrange sums, from concluding that (a + b) − a is b and that nothing was lost.
const LARGEST_FLOAT = 3.4028234663852886e38;

/// a + b = x + y exactly, x the rounded sum.
fn two_sum(a: f32, b: f32) -> vec2f {
    let s = min(a + b, LARGEST_FLOAT);
    let t = min(s - a, LARGEST_FLOAT);
    return vec2f(s, (a - (s - t)) + (b - t));
}

/// What rounding loses in a + b, component by component.
fn sum_error(a: vec4f, b: vec4f) -> vec4f {
    let s = min(a + b, vec4f(LARGEST_FLOAT));
    let t = min(s - a, vec4f(LARGEST_FLOAT));
    return (a - (s - t)) + (b - t);
}

/// a·b = x + y exactly, x the rounded product, unless it overflows or underflows.
fn two_product(a: f32, b: f32) -> vec2f {
    // Held like the sums above: a driver may fuse a product into the sum that it goes to, unrounded.
    let p = min(a * b, LARGEST_FLOAT);
    let ah = bitcast<f32>(bitcast<u32>(a) & 0xfffff000u);
    let bh = bitcast<f32>(bitcast<u32>(b) & 0xfffff000u);
    let al = a - ah;
    let bl = b - bh;
    return vec2f(p, ((ah * bh - p) + (ah * bl + al * bh)) + al * bl);
}

/// p + q
fn wide_add(p: vec2f, q: vec2f) -> vec2f {
    let s = two_sum(p.x, q.x);
    return two_sum(s.x, s.y + (p.y + q.y));
}

/// p·k
fn wide_scale(p: vec2f, k: f32) -> vec2f {
    let q = two_product(p.x, k);
    return two_sum(q.x, q.y + p.y * k);
}

/// p·q
fn wide_multiply(p: vec2f, q: vec2f) -> vec2f {
    let r = two_product(p.x, q.x);
    return two_sum(r.x, r.y + (p.x * q.y + p.y * q.x));
}

/// Whether p < q. Pairs made here are normalised, so their first parts decide unless they are equal.
fn wide_less(p: vec2f, q: vec2f) -> bool {
    return p.x < q.x || (p.x == q.x && p.y < q.y);
}

/// Luminance of a colour, exactly the value of a grey one.
fn grey_luminance(c: vec3f) -> f32 {
    let y = 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
    return select(y, c.r, c.r == c.g && c.g == c.b);
}

/// The same to about 45 bits.
fn wide_luminance(c: vec3f) -> vec2f {
    // What 32 bits leave of the weights 0.2126, 0.7152 and 0.0722.
    let r = two_product(0.2126, c.r);
    let g = two_product(0.7152, c.g);
    let b = two_product(0.0722, c.b);
    let low = dot(vec3f(7.247925e-9, -6.9618227e-9, -2.861023e-10), c) + (r.y + g.y + b.y);
    let rg = two_sum(r.x, g.x);
    let rgb = two_sum(rg.x, b.x);
    let y = two_sum(rgb.x, low + (rg.y + rgb.y));
    let plain = grey_luminance(c);
    let grey = c.r == c.g && c.g == c.b;
    let finite = (bitcast<u32>(plain) & 0x7f800000u) != 0x7f800000u;
    return select(vec2f(plain, 0.0), y, finite && !grey);
}

/// Luminance rounded once.
fn exact_luminance(c: vec3f) -> f32 {
    return wide_luminance(c).x;
}

/// What is measured of a pixel. View 0: its channels; 1: its luminance, in every component; 2: its colour and luminance.
fn viewed(c: vec4f, view: i32) -> vec4f {
    if view == 1 {
        return vec4f(grey_luminance(c.rgb));
    }
    if view == 2 {
        return vec4f(c.rgb, grey_luminance(c.rgb));
    }
    return c;
}

/// Where v lies among `bins` equal bins over lo..hi: the bin floor((v − lo)/(hi − lo)·bins) of the true quotient, with hi
/// in the last bin, and how far inside it, 0..1. The bin is −1 below lo and `bins` above hi. v is a pair and no NaN.
/// All is in the first bin when hi = lo.
fn place_in_bins(v: vec2f, lo: f32, hi: f32, bins: i32) -> vec2f {
    let n = f32(bins);
    let range = two_sum(hi, -lo);
    let above = two_sum(v.x, -lo);
    let left = above.y + v.y;
    // The nearest edge, and the distance from it in units of the range: both products without rounding, so that
    // their difference is right to the last digit.
    let edge = clamp(floor((above.x + left) / range.x * n + 0.5), 0.0, n);
    let p = two_product(above.x, n);
    let q = two_product(range.x, edge);
    let d = (p.x - q.x) + ((p.y + left * n) - (q.y + range.y * edge));
    var place = vec2f(edge, d / range.x);
    if d < 0.0 {
        place = vec2f(edge - 1.0, 1.0 + place.y);
    }
    if place.x >= n {
        place = vec2f(n - 1.0, 1.0);
    }
    if wide_less(v, vec2f(lo, 0.0)) {
        place = vec2f(-1.0, 0.0);
    }
    if wide_less(vec2f(hi, 0.0), v) {
        place = vec2f(n, 0.0);
    }
    return select(vec2f(), place, lo < hi);
}

/// The bin of `place_in_bins`.
fn bin_index(v: vec2f, lo: f32, hi: f32, bins: i32) -> i32 {
    return i32(place_in_bins(v, lo, hi, bins).x);
}

/// The bin that a pixel falls in, or −1. Channel 0 is the luminance, 1 to 4 are R, G, B, A. NaN and infinity fall in
/// none; what else lies outside lo..hi falls in the first or last bin when `clamped`.
fn bin_of_pixel(c: vec4f, channel: i32, lo: f32, hi: f32, bins: i32, clamped: bool) -> i32 {
    var v = vec2f(c.a, 0.0);
    if channel == 0 {
        v = wide_luminance(c.rgb);
    } else if channel < 4 {
        v = vec2f(c[channel - 1], 0.0);
    }
    if (bitcast<u32>(v.x) & 0x7f800000u) == 0x7f800000u {
        return -1;
    }
    let k = bin_index(v, lo, hi, bins);
    if clamped {
        return clamp(k, 0, bins - 1);
    }
    return select(k, -1, k == bins);
}

/// As `bin_of_pixel` by plain arithmetic, or −2 where that puts the value too close to the edge of a bin to tell.
fn quick_bin_of_pixel(c: vec4f, channel: i32, lo: f32, hi: f32, bins: i32, clamped: bool) -> i32 {
    var v = c.a;
    // How far v may be from what it should be.
    var slack = 0.0;
    if channel == 0 {
        v = grey_luminance(c.rgb);
        slack = select(dot(abs(c.rgb), vec3f(6e-8, 1.8e-7, 2e-8)), 0.0, c.r == c.g && c.g == c.b);
    } else if channel < 4 {
        v = c[channel - 1];
    }
    let n = f32(bins);
    let scale = n / (hi - lo);
    let t = (v - lo) * scale;
    let whole = floor(t);
    let rest = t - whole;
    let margin = n * 5e-7 + slack * scale;
    var k = i32(clamp(whole, -1.0, n));
    if clamped {
        k = clamp(k, 0, bins - 1);
    } else {
        k = select(k, -1, k == bins);
    }
    // Black is common, and no rounding stands between it and the first edge.
    let sure = (rest >= margin && rest <= 1.0 - margin) || (v == lo && slack == 0.0) || abs(t) > 2.0 * n + 2.0;
    k = select(-2, k, sure && lo < hi);
    return select(k, -1, (bitcast<u32>(v) & 0x7f800000u) == 0x7f800000u);
}

/// a·b as (low word, high word).
fn wide_product(a: u32, b: u32) -> vec2u {
    let al = a & 0xffffu;
    let ah = a >> 16u;
    let bl = b & 0xffffu;
    let bh = b >> 16u;
    let low = al * bl;
    let middle = ah * bl + (low >> 16u);
    let cross = al * bh + (middle & 0xffffu);
    return vec2u((cross << 16u) | (low & 0xffffu), ah * bh + (middle >> 16u) + (cross >> 16u));
}

/// p − q of two-word integers, p not below q.
fn wide_difference(p: vec2u, q: vec2u) -> vec2u {
    return vec2u(p.x - q.x, p.y - q.y - select(0u, 1u, p.x < q.x));
}

/// Whether p < q of two-word integers.
fn wide_below(p: vec2u, q: vec2u) -> bool {
    return p.y < q.y || (p.y == q.y && p.x < q.x);
}
