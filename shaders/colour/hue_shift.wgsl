// Rodrigues: v cos θ + (k × v) sin θ + k (k·v)(1 − cos θ), k = (1, 1, 1)/√3

fn apply(image: vec4f) -> vec4f {
    let v = image.rgb;
    let mean = (v.r + v.g + v.b) / 3.0;
    let turned = vec3f(v.b - v.g, v.r - v.b, v.g - v.r) * 0.57735026918962576;
    return vec4f(v * params.cosine + turned * params.sine + mean * (1.0 - params.cosine), image.a);
}
