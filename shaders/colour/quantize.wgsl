// ROUNDING: 0 up, 1 nearest, 2 down

import package::lib::color::keep_nan;

fn level(v: vec3f) -> vec3f {
    let l = params.levels;
    if ROUNDING == 0 {
        return max(vec3f(1.0), ceil(v * l)) / l;
    }
    if ROUNDING == 1 {
        return floor(v * (l - 1.0) + 0.5) / (l - 1.0);
    }
    return min(vec3f(l - 1.0), floor(v * l)) / (l - 1.0);
}

fn apply(image: vec4f) -> vec4f {
    let v = clamp(image.rgb, vec3f(0.0), vec3f(1.0));
    return vec4f(keep_nan(level(v), image.rgb), image.a);
}
