// Rows of the matrix times the colour.

fn apply(image: vec4f) -> vec4f {
    return vec4f(dot(params.r, image), dot(params.g, image), dot(params.b, image), dot(params.a, image));
}
