// Sums of every stride-th entry.

import package::lib::wide::two_sum;

fn strided_sum(first: i32) -> f32 {
    var sum = vec2f(0.0);
    for (var i = first; i < size_terms(); i += params.stride) {
        let next = two_sum(sum.x, load_terms(i));
        sum = vec2f(next.x, sum.y + next.y);
    }
    return sum.x + sum.y;
}
