// Arithmetic wider than 32 bits: an unevaluated sum of two floats, and products of integers as two words.
//
// Sums of many terms carry what rounding loses (Knuth's two-sum), products are exact by Dekker's splitting:
// Shewchuk, Adaptive Precision Floating-Point Arithmetic, 1997. Neither needs a fused multiply-add, which some
// devices do not have, and neither is spoiled by one.

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
    let p = a * b;
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

/// Y = 0.2126 R + 0.7152 G + 0.0722 B to about 45 bits; exactly the value of a grey pixel.
fn wide_luminance(c: vec3f) -> vec2f {
    if c.r == c.g && c.g == c.b {
        return vec2f(c.r, 0.0);
    }
    let plain = 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
    if (bitcast<u32>(plain) & 0x7f800000u) == 0x7f800000u {
        return vec2f(plain, 0.0);
    }
    // The weights as pairs: what 32 bits leave of 0.2126, 0.7152 and 0.0722.
    let r = wide_scale(vec2f(0.2126, 7.247925e-9), c.r);
    let g = wide_scale(vec2f(0.7152, -6.9618227e-9), c.g);
    let b = wide_scale(vec2f(0.0722, -2.861023e-10), c.b);
    return wide_add(wide_add(r, g), b);
}

/// Luminance rounded once; exactly the value of a grey pixel.
fn exact_luminance(c: vec3f) -> f32 {
    return wide_luminance(c).x;
}

/// What is measured of a pixel. View 0: its channels; 1: its luminance, in every component; 2: its colour and luminance.
fn viewed(c: vec4f, view: i32) -> vec4f {
    if view == 1 {
        return vec4f(exact_luminance(c.rgb));
    }
    if view == 2 {
        return vec4f(c.rgb, exact_luminance(c.rgb));
    }
    return c;
}

/// The bin of v among `bins` equal bins over lo..hi: floor((v − lo)/(hi − lo)·bins) of the true quotient, with hi
/// in the last bin; −1 below lo, `bins` above hi. v is a pair and no NaN. All bins are the first when hi = lo.
fn bin_index(v: vec2f, lo: f32, hi: f32, bins: i32) -> i32 {
    if wide_less(v, vec2f(lo, 0.0)) {
        return -1;
    }
    if wide_less(vec2f(hi, 0.0), v) {
        return bins;
    }
    if hi <= lo {
        return 0;
    }
    let n = f32(bins);
    let t = ((v.x - lo) + v.y) / (hi - lo) * n;
    var k = i32(clamp(floor(t), 0.0, n - 1.0));
    // The quotient is right to a few units in the last place; only beside the edge of a bin can that matter.
    let margin = n * 5e-7;
    let rest = t - f32(k);
    if rest < margin || rest > 1.0 - margin {
        let range = two_sum(hi, -lo);
        let left = wide_scale(wide_add(v, vec2f(-lo, 0.0)), n);
        if k > 0 && wide_less(left, wide_scale(range, f32(k))) {
            k -= 1;
        } else if k < bins - 1 && !wide_less(left, wide_scale(range, f32(k + 1))) {
            k += 1;
        }
    }
    return k;
}

/// How far into its bin v lies, 0..1, to the last digit even where bins are narrow and values large.
fn bin_fraction(v: vec2f, lo: f32, hi: f32, bins: i32, bin: i32) -> f32 {
    if v.x <= lo || v.x >= hi {
        return select(0.0, 1.0, v.x >= hi);
    }
    let left = wide_scale(wide_add(v, vec2f(-lo, 0.0)), f32(bins));
    let edge = wide_scale(two_sum(hi, -lo), f32(bin));
    return clamp(wide_add(left, -edge).x / (hi - lo), 0.0, 1.0);
}

/// The bin that a pixel falls in, or −1. Channel 0 is the luminance, 1 to 4 are R, G, B, A. NaN falls in none; what
/// lies outside lo..hi falls in the first or last bin when `clamped`.
fn bin_of_pixel(c: vec4f, channel: i32, lo: f32, hi: f32, bins: i32, clamped: bool) -> i32 {
    var v = vec2f(c.a, 0.0);
    if channel == 0 {
        v = wide_luminance(c.rgb);
    } else if channel < 4 {
        v = vec2f(c[channel - 1], 0.0);
    }
    if (bitcast<u32>(v.x) & 0x7fffffffu) > 0x7f800000u {
        return -1;
    }
    let k = bin_index(v, lo, hi, bins);
    if clamped {
        return clamp(k, 0, bins - 1);
    }
    return select(k, -1, k == bins);
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
