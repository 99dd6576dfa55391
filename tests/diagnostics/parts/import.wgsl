import package::lib::colour::luminance;

fn apply(image: vec4f) -> vec4f {
    return vec4f(luminance(image.rgb));
}
