// The fraction of a shift does not depend on where the pixel lies, so far pixels are as exact as near ones.

import package::lib::number::is_nan;
import package::lib::texel::texel;
import package::lib::wide::{two_product, wide_add};

fn at(xy: vec2i) -> vec4f {
    let map = load_map(xy);
    let sum = map.r + map.g;
    if is_nan(sum) {
        return vec4f(sum);
    }
    let dx = two_product(params.scale.x, map.r);
    let dy = two_product(params.scale.y, map.g);
    if !LINEAR {
        let half = vec2f(0.5, 0.0);
        return load_image(xy + vec2i(texel(wide_add(dx, half)).index, texel(wide_add(dy, half)).index));
    }
    let x = texel(dx);
    let y = texel(dy);
    let p = xy + vec2i(x.index, y.index);
    let above = mix(load_image(p), load_image(p + vec2i(1, 0)), x.fraction);
    let below = mix(load_image(p + vec2i(0, 1)), load_image(p + vec2i(1, 1)), x.fraction);
    return mix(above, below, y.fraction);
}
