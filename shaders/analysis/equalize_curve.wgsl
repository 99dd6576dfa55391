// The level of every bin: floor(STEPS·cumulative/total)/STEPS, exact.

fn at(bin: i32) -> f32 {
    let part = load_cumulative(bin);
    let total = load_cumulative(size_cumulative() - 1);
    if total == 0u {
        return 0.0;
    }
    // Long division of STEPS·part by total, one bit of STEPS (of 16) at a time: no product leaves 32 bits.
    var quotient = 0u;
    var rest = 0u;
    for (var bit = 0u; bit < 16u; bit++) {
        quotient *= 2u;
        rest *= 2u;
        if (STEPS & (0x8000u >> bit)) != 0u {
            rest += part;
        }
        if rest >= total {
            rest -= total;
            quotient += 1u;
        }
        if rest >= total {
            rest -= total;
            quotient += 1u;
        }
    }
    return f32(quotient) / f32(STEPS);
}
