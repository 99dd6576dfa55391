// Sums of many terms that carry their rounding error along (Neumaier 1974).

import package::lib::number::not_finite;

struct Running {
    sum: vec4f,
    lost: vec4f,
}

fn plus(to: Running, v: vec4f) -> Running {
    let t = to.sum + v;
    let lost = select((v - t) + to.sum, (to.sum - t) + v, abs(to.sum) >= abs(v));
    return Running(t, to.lost + lost);
}

/// The sum. What an infinite one lost is no number.
fn total(terms: Running) -> vec4f {
    return select(terms.sum + terms.lost, terms.sum, not_finite(terms.sum));
}
