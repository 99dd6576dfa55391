// Sums of every stride-th integer of two words, the first at params.first, params.apart words apart.

fn strided_total(first: i32) -> vec2u {
    var low = 0u;
    var high = 0u;
    for (var i = first; i < params.count; i += params.stride) {
        let at = params.first + i * params.apart;
        low += load_terms(at);
        high += load_terms(at + 1) + select(0u, 1u, low < load_terms(at));
    }
    return vec2u(low, high);
}
