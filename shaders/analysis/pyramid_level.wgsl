// One level of the pyramid from the finer one: the mean of up to 2×2 pixels, each weighted by how many values of the
// image it stands for. Geometric means stay logarithms between levels; the first level takes them.

import package::lib::number::is_finite;

fn each(xy: vec2i) {
    let size = size_finer();
    var sum = vec4f();
    var count = vec4f();
    for (var j = 0; j < 2; j++) {
        for (var i = 0; i < 2; i++) {
            let at = xy * 2 + vec2i(i, j);
            if at.x < size.x && at.y < size.y {
                let v = load_finer(at);
                let counts = load_counts(at);
                for (var c = 0; c < 4; c++) {
                    if FIRST {
                        if is_finite(v[c]) {
                            sum[c] += select(v[c], log(params.epsilon + max(v[c], 0.0)), GEOMETRIC);
                            count[c] += 1.0;
                        }
                    } else {
                        sum[c] += v[c] * counts[c];
                        count[c] += counts[c];
                    }
                }
            }
        }
    }
    let mean = sum / max(count, vec4f(1.0));
    store_coarser(xy, mean);
    store_coarser_counts(xy, count);
    var shown = mean;
    if GEOMETRIC {
        shown = exp(mean);
    }
    store_picture(params.origin + xy, select(vec4f(), shown, count > vec4f()));
}
