// in + intensity·blurred

fn apply(image: vec4f, blurred: vec4f) -> vec4f {
    return vec4f(image.rgb + params.intensity * blurred.rgb, image.a);
}
