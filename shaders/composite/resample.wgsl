// Weighted sums along one axis (AXIS 0: x, 1: y), with weights from a table: see resampling.rs.

import package::lib::number::is_finite;
import package::lib::wide::sum_error;

fn at(xy: vec2i) -> vec4f {
    let along = select(xy.x, xy.y, AXIS == 1);
    let phase = along % params.period;
    let first = bitcast<i32>(load_firsts(phase)) + along / params.period * params.step;
    let row = phase * params.width;
    var total = vec4f(0.0);
    var lost = vec4f(0.0);
    // Blocks of 64 terms, joined with what rounding loses: long sums stay as good as short ones.
    for (var begin = 0; begin < params.width; begin += 64) {
        var part = vec4f(0.0);
        for (var k = begin; k < min(begin + 64, params.width); k++) {
            let place = select(vec2i(first + k, xy.y), vec2i(xy.x, first + k), AXIS == 1);
            part += load_weights(row + k) * load_image(place);
        }
        lost += sum_error(total, part);
        total += part;
    }
    // Where a sum is infinite, what it lost is no number.
    let whole = vec4<bool>(is_finite(total.r), is_finite(total.g), is_finite(total.b), is_finite(total.a));
    return select(total, total + lost, whole);
}
