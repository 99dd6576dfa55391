// One colour.

fn apply() -> vec4f {
    return params.color;
}
