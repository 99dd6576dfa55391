// The sums of all tiles → one number for each component: FINISH 0 the mean, 1 the exponential of the mean, 2 how
// many values took part. 0 when none did.

import package::lib::wide::sum_error;

const LANES = 256u;

var<workgroup> sums: array<vec4f, LANES>;
var<workgroup> errors: array<vec4f, LANES>;
var<workgroup> counts: array<vec4f, LANES>;

fn finish(total: vec4f, count: vec4f) -> vec4f {
    let mean = select(vec4f(), total / max(count, vec4f(1.0)), count > vec4f(0.0));
    if FINISH == 1 {
        return select(vec4f(), exp(mean), count > vec4f(0.0));
    }
    if FINISH == 2 {
        return count;
    }
    return mean;
}

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32) {
    let n = count_of_partials();
    var sum = vec4f();
    var error = vec4f();
    var count = vec4f();
    for (var i = i32(lane); i < n; i += i32(LANES)) {
        let term = run_of(0, i);
        error += sum_error(sum, term) + run_of(1, i);
        sum += term;
        count += run_of(2, i);
    }
    sums[lane] = sum;
    errors[lane] = error;
    counts[lane] = count;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            let other = sums[lane + half];
            let mine = sums[lane];
            errors[lane] += errors[lane + half] + sum_error(mine, other);
            sums[lane] = mine + other;
            counts[lane] += counts[lane + half];
        }
    }
    if lane == 0u {
        store_out(finish(sums[0] + errors[0], counts[0]));
    }
}
