// An affine map from the frame back to the image, in pairs of floats; KERNEL is the position in the enum of resampling.rs.

import package::lib::sine::sinc;
import package::lib::texel::texel;
import package::lib::wide::{wide_add, wide_scale};

fn cubic(x: f32, b: f32, c: f32) -> f32 {
    if x < 1.0 {
        return (((12.0 - 9.0 * b - 6.0 * c) * x + (-18.0 + 12.0 * b + 6.0 * c)) * x * x + (6.0 - 2.0 * b)) / 6.0;
    }
    if x < 2.0 {
        return (((-b - 6.0 * c) * x + (6.0 * b + 30.0 * c)) * x * x + (-12.0 * b - 48.0 * c) * x + (8.0 * b + 24.0 * c)) / 6.0;
    }
    return 0.0;
}

fn weight(distance: f32) -> f32 {
    let x = abs(distance);
    switch KERNEL {
        case 1: { return max(1.0 - x, 0.0); }
        case 2: { return cubic(x, 0.0, 0.5); }
        case 3: { return cubic(x, 1.0 / 3.0, 1.0 / 3.0); }
        default: { return select(0.0, sinc(x) * sinc(x / 3.0), x < 3.0); }
    }
}

fn at(xy: vec2i) -> vec4f {
    let p = vec2f(xy) + 0.5;
    let u = wide_add(wide_add(wide_scale(params.xx, p.x), wide_scale(params.xy, p.y)), params.x0);
    let v = wide_add(wide_add(wide_scale(params.yx, p.x), wide_scale(params.yy, p.y)), params.y0);
    if KERNEL == 0 {
        return load_image(vec2i(texel(u).index, texel(v).index));
    }
    let x = texel(wide_add(u, vec2f(-0.5, 0.0)));
    let y = texel(wide_add(v, vec2f(-0.5, 0.0)));
    var sum = vec4f(0.0);
    var weights = 0.0;
    for (var j = 1 - RADIUS; j <= RADIUS; j++) {
        let down = weight(f32(j) - y.fraction);
        var row = vec4f(0.0);
        var across = 0.0;
        for (var i = 1 - RADIUS; i <= RADIUS; i++) {
            let w = weight(f32(i) - x.fraction);
            row += w * load_image(vec2i(x.index + i, y.index + j));
            across += w;
        }
        sum += down * row;
        weights += down * across;
    }
    return sum / weights;
}
