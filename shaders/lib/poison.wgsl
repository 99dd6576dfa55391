// Values that are no finite numbers, in filters that feed their result back: there one of them would never die away.

import package::lib::number::not_finite;

/// The last value that was not finite, and for how many pixels it still spreads.
struct Poison {
    value: vec4f,
    left: vec4i,
}

/// One pixel on: `v` is what comes in, `radius` how far it spreads.
fn poisoned(by: Poison, v: vec4f, radius: i32) -> Poison {
    let bad = not_finite(v);
    return Poison(select(by.value, v, bad), select(by.left - 1, vec4i(radius), bad));
}

/// What a filter may keep of `v`.
fn antidote(v: vec4f) -> vec4f {
    return select(v, vec4f(), not_finite(v));
}

/// What comes out where `v` would.
fn outcome(by: Poison, v: vec4f) -> vec4f {
    return select(v, by.value, by.left >= vec4i());
}
