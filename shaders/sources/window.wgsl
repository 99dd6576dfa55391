// Values of a file from low to high as 0..1, clamped.

fn at(xyz: vec3i) -> vec4f {
    let v = load_file(xyz);
    return clamp((v - params.low) / (params.high - params.low), vec4f(0.0), vec4f(1.0));
}
