// ROUNDING: 0 up, 1 nearest, 2 down

fn apply(image: vec4f) -> vec4f {
    let v = clamp(image.rgb, vec3f(0.0), vec3f(1.0));
    let l = params.levels;
    if ROUNDING == 0 {
        return vec4f(max(vec3f(1.0), ceil(v * l)) / l, image.a);
    }
    if ROUNDING == 1 {
        return vec4f(floor(v * (l - 1.0) + 0.5) / (l - 1.0), image.a);
    }
    return vec4f(min(vec3f(l - 1.0), floor(v * l)) / (l - 1.0), image.a);
}
