// Level 0 of the pyramid in its place; 0 elsewhere, until the other levels arrive. GEOMETRIC shows what the
// logarithm is taken of. A value that is not finite counts as a mean of nothing: 0.

import package::lib::number::is_finite;

fn at(xy: vec2i) -> vec4f {
    let size = size_image();
    if xy.x >= size.x || xy.y >= size.y {
        return vec4f();
    }
    var v = load_image(xy);
    for (var c = 0; c < 4; c++) {
        if !is_finite(v[c]) {
            v[c] = 0.0;
        } else if GEOMETRIC {
            v[c] = params.epsilon + max(v[c], 0.0);
        }
    }
    return v;
}
