import package::lib::number::is_nan;
import package::lib::texel::texel;
import package::lib::wide::{two_product, wide_add};

fn at(xy: vec2i) -> vec4f {
    let coords = load_coords(xy);
    let sum = coords.r + coords.g;
    if is_nan(sum) {
        return vec4f(sum);
    }
    let size = select(vec2f(1.0), vec2f(size_image()), NORMALIZED);
    let u = two_product(coords.r, size.x);
    let v = two_product(coords.g, size.y);
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
