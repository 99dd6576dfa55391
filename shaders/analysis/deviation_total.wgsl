// The moments of all tiles → the standard deviation of the population, 0 without any value.

import package::lib::moments::{Moments, joined_moments};

const LANES = 256u;

var<workgroup> sets: array<Moments, LANES>;

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32) {
    let n = count_of_partials();
    var own = Moments(vec4f(), vec4f(), vec4f(), vec4f());
    for (var i = i32(lane); i < n; i += i32(LANES)) {
        own = joined_moments(own, Moments(run_of(0, i), run_of(1, i), run_of(2, i), run_of(3, i)));
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
