// in + amount·(in − blur), where |in − blur| > threshold

fn apply(image: vec4f, blurred: vec4f) -> vec4f {
    let d = image.rgb - blurred.rgb;
    return vec4f(select(image.rgb, image.rgb + params.amount * d, abs(d) > vec3f(params.threshold)), image.a);
}
