import package::lib::number::is_nan;
import package::lib::texel::texel;
import package::lib::wide::{two_product, wide_add};

fn slice(p: vec3i, x: f32, y: f32) -> vec4f {
    let above = mix(load_image(p), load_image(p + vec3i(1, 0, 0)), x);
    let below = mix(load_image(p + vec3i(0, 1, 0)), load_image(p + vec3i(1, 1, 0)), x);
    return mix(above, below, y);
}

fn at(xy: vec2i) -> vec4f {
    let coords = load_coords(xy);
    let sum = coords.r + coords.g + coords.b;
    if is_nan(sum) {
        return vec4f(sum);
    }
    let size = select(vec3f(1.0), vec3f(size_image()), NORMALIZED);
    let u = two_product(coords.r, size.x);
    let v = two_product(coords.g, size.y);
    let w = two_product(coords.b, size.z);
    if !LINEAR {
        return load_image(vec3i(texel(u).index, texel(v).index, texel(w).index));
    }
    let half = vec2f(-0.5, 0.0);
    let x = texel(wide_add(u, half));
    let y = texel(wide_add(v, half));
    let z = texel(wide_add(w, half));
    let p = vec3i(x.index, y.index, z.index);
    let near = slice(p, x.fraction, y.fraction);
    let far = slice(p + vec3i(0, 0, 1), x.fraction, y.fraction);
    return mix(near, far, z.fraction);
}
