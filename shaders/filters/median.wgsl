// Floats as integers of the same order, a NaN above all others. Devices agree about the smaller of two integers, not about
// that of a number and a NaN. The function `at` is written by median.rs.

fn order(v: vec4f) -> vec4i {
    let bits = bitcast<vec4i>(v);
    let nan = (bits & vec4i(0x7fffffff)) > vec4i(0x7f800000);
    return select(flip(bits), vec4i(0x7fc00000), nan);
}

fn value(order: vec4i) -> vec4f {
    return bitcast<vec4f>(flip(order));
}

/// Negative floats grow with their bits downwards.
fn flip(bits: vec4i) -> vec4i {
    return bits ^ ((bits >> vec4u(31u)) & vec4i(0x7fffffff));
}
