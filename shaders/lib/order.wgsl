// Floats as unsigned integers of the same order.

/// An integer that grows with v: −∞ < … < −0 < +0 < … < +∞.
fn order_of(v: f32) -> u32 {
    let bits = bitcast<u32>(v);
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

/// The orders of four floats.
fn orders_of(v: vec4f) -> vec4u {
    let bits = bitcast<vec4u>(v);
    return select(bits | vec4u(0x80000000u), ~bits, (bits & vec4u(0x80000000u)) != vec4u());
}

/// The float of an order.
fn value_of_order(order: u32) -> f32 {
    return bitcast<f32>(select(~order, order & 0x7fffffffu, (order & 0x80000000u) != 0u));
}
