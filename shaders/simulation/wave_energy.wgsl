// ½v²·dx² + ½c²·(differences of u)² over 64 rows of one column, neighbouring threads in neighbouring columns. Sums carry
// what rounding loses.

import package::lib::wide::two_sum;

fn at(i: i32) -> f32 {
    let size = size_state();
    let x = i % size.x;
    let first = i / size.x * 64;
    var sum = vec2f(0.0);
    for (var y = first; y < min(first + 64, size.y); y++) {
        let state = load_state(vec2i(x, y)).xy;
        let right = load_state(vec2i(x + 1, y)).x - state.x;
        let below = load_state(vec2i(x, y + 1)).x - state.x;
        var pull = right * right + below * below;
        if FIXED {
            pull += state.x * state.x * (select(0.0, 1.0, x == 0) + select(0.0, 1.0, y == 0));
        }
        let next = two_sum(sum.x, 0.5 * (params.area * state.y * state.y + params.c2 * pull));
        sum = vec2f(next.x, sum.y + next.y);
    }
    return sum.x + sum.y;
}
