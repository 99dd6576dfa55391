// Between two of 256 colours.

import package::lib::color::luminance;
import package::lib::number::is_nan;

fn color(i: i32) -> vec3f {
    return vec3f(load_colors(3 * i), load_colors(3 * i + 1), load_colors(3 * i + 2));
}

fn apply(image: vec4f) -> vec4f {
    let y = luminance(image.rgb);
    let at = clamp(y, 0.0, 1.0) * 255.0;
    let i = min(i32(at), 254);
    let c = mix(color(i), color(i + 1), at - f32(i));
    return vec4f(select(c, vec3f(y), is_nan(y)), image.a);
}
