// Counts → a density whose integral over the range is 1: counts/(N·Δg), N of them counted. 0 when N = 0.

fn at(bin: i32) -> f32 {
    let total = f32(load_total(0));
    if total == 0.0 {
        return 0.0;
    }
    return f32(load_counts(bin)) / total / params.width;
}
