import package::lib::number::is_nan;
import package::lib::texel::texel;
import package::lib::wide::{two_product, wide_add, wide_scale};

fn at(xy: vec2i) -> vec4f {
    let map = load_map(xy);
    let sum = map.r + map.g;
    if is_nan(sum) {
        return vec4f(sum);
    }
    let size = vec2f(size_image());
    let u = wide_scale(two_product(params.scale.x, map.r), size.x);
    let v = wide_scale(two_product(params.scale.y, map.g), size.y);
    if !LINEAR {
        return load_image(vec2i(texel(u).index, texel(v).index));
    }
    let half = vec2f(-0.5, 0.0);
    let x = texel(wide_add(u, half));
    let y = texel(wide_add(v, half));
    let p = vec2i(x.index, y.index);
    let above = mix(load_image(p), load_image(p + vec2i(1, 0)), x.fraction);
    let below = mix(load_image(p + vec2i(0, 1)), load_image(p + vec2i(1, 1)), x.fraction);
    return mix(above, below, y.fraction);
}
