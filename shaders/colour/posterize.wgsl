// round(c·steps)/steps

import package::lib::color::keep_nan;

fn apply(image: vec4f) -> vec4f {
    let v = clamp(image.rgb, vec3f(0.0), vec3f(1.0));
    return vec4f(keep_nan(floor(v * params.steps + 0.5) / params.steps, image.rgb), image.a);
}
