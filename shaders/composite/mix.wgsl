// a·(1 − t) + b·t

fn apply(a: vec4f, b: vec4f) -> vec4f {
    return a * (1.0 - params.factor) + b * params.factor;
}
