// One level of the pyramid from the finer one: the mean of up to 2×2 pixels, each weighted by the pixels of the
// image that it covers. Geometric means stay logarithms between levels; the first level takes them. A pixel
// without a finite value stays as it is, so that the next level leaves it out too.

import package::lib::number::is_finite;

/// How many pixels of the image a pixel of the finer level covers along one axis, at most 2^(LEVEL − 1).
fn covered(i: i32, whole: i32) -> i32 {
    let side = 1 << (LEVEL - 1u);
    return min(side, whole - i * side);
}

fn each(xy: vec2i) {
    let size = size_finer();
    var sum = vec4f();
    var weights = vec4f();
    var lost = vec4f();
    for (var j = 0; j < 2; j++) {
        for (var i = 0; i < 2; i++) {
            let at = xy * 2 + vec2i(i, j);
            if at.x < size.x && at.y < size.y {
                let weight = f32(covered(at.x, params.whole.x) * covered(at.y, params.whole.y));
                let v = load_finer(at);
                for (var c = 0; c < 4; c++) {
                    if is_finite(v[c]) {
                        var term = v[c];
                        if GEOMETRIC && FIRST {
                            term = log(params.epsilon + max(term, 0.0));
                        }
                        sum[c] += term * weight;
                        weights[c] += weight;
                    } else {
                        lost[c] = v[c];
                    }
                }
            }
        }
    }
    let mean = sum / max(weights, vec4f(1.0));
    var shown = mean;
    if GEOMETRIC {
        shown = exp(mean);
    }
    let some = weights > vec4f(0.0);
    store_coarser(xy, select(lost, mean, some));
    store_picture(params.origin + xy, select(vec4f(), shown, some));
}
