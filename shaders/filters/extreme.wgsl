// The largest or smallest of the value so far and of the image at some offsets.

import package::lib::extremes::maximum;
import package::lib::extremes::minimum;

fn at(xy: vec2i) -> vec4f {
    var best = load_so_far(xy);
    for (var i = 0; i < size_offsets(); i += 2) {
        let v = load_image(xy + vec2i(i32(load_offsets(i)), i32(load_offsets(i + 1))));
        if LARGEST {
            best = maximum(best, v);
        } else {
            best = minimum(best, v);
        }
    }
    return best;
}
