// round(c·steps)/steps

fn apply(image: vec4f) -> vec4f {
    return vec4f(floor(clamp(image.rgb, vec3f(0.0), vec3f(1.0)) * params.steps + 0.5) / params.steps, image.a);
}
