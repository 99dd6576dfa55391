// g_max·(G − low)/(high − low), 0 where low = high.

fn apply(image: vec4f) -> vec4f {
    let range = params.high - params.low;
    if range == 0.0 {
        return vec4f(vec3f(), image.a);
    }
    return vec4f((image.rgb - params.low) / range * params.g_max, image.a);
}
