// The moments of all tiles → the standard deviation of the population, 0 without any value.

import package::lib::moments::{Moments, joined_moments};

const LANES = 256u;

var<workgroup> sets: array<Moments, LANES>;

fn run_of(part: i32, index: i32, n: i32) -> vec4f {
    let first = part * 4 * n + index;
    return vec4f(load_partials(first), load_partials(first + n), load_partials(first + 2 * n), load_partials(first + 3 * n));
}

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32) {
    let n = size_partials() / 16;
    var own = Moments(vec4f(), vec4f(), vec4f(), vec4f());
    for (var i = i32(lane); i < n; i += i32(LANES)) {
        own = joined_moments(own, Moments(run_of(0, i, n), run_of(1, i, n), run_of(2, i, n), run_of(3, i, n)));
    }
    sets[lane] = own;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            sets[lane] = joined_moments(sets[lane], sets[lane + half]);
        }
    }
    if lane == 0u {
        store_out(sqrt(sets[0].squares / max(sets[0].count, vec4f(1.0))));
    }
}
