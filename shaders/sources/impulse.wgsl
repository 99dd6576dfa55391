// One pixel.

fn apply() -> vec4f {
    return vec4f(select(0.0, params.value, all(pixel() == params.at)));
}
